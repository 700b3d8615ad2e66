"""What recordings hold: guesses from names and behaviour, tables of them, and the pipeline that reads them."""
