"""A picture of 640 x 480 pixels, as small as one can be."""

JPEG = (
    bytes.fromhex("ffd8 ffe0 0004 0000 ffc0 0011 08 01e0 0280 03 011100021100031100 ffda".replace(" ", ""))
    + b"data"
)
