"""The host's side: bring-up, supervised motion and controlled stop of CiA 402 drives, through canopen."""

from robid_can.host.host import Host
from robid_can.host.link import Link
from robid_can.host.remote import ExpectedDrive

__all__ = ["ExpectedDrive", "Host", "Link"]
