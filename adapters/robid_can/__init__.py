"""CiA 402 drives on a CAN bus: the object dictionary, the host's side and a simulated drive's side.

`host` and `drive` are two codecs of the same standard and import nothing of each other; they share the
`dictionary` and the `frame`. `drives` puts them together behind the core's noun.
"""
