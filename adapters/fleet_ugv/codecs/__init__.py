"""The words of serial bases, without I/O: bytes in, events out; what is asked in, bytes out."""
