"""Damaged and forged copies of a motion library (docs/formats/motion-library.md)."""

import struct

import wire

HEADER, FOOTER = 24, 24


def resealed(library):
    """Repairs lengths and checksums of header and footer, but not of the blocks."""
    data = bytearray(library)
    if len(data) < HEADER + FOOTER:
        return bytes(data)
    struct.pack_into("<I", data, 12, len(data))
    struct.pack_into("<I", data, 20, wire.crc32c(data[:20]))
    at = len(data) - FOOTER
    struct.pack_into("<II", data, at + 8, len(data), wire.crc32c(data[:at]))
    struct.pack_into("<I", data, at + 20, wire.crc32c(data[at : at + 20]))
    return bytes(data)


def sections(library):
    """Offsets of the heads of the sections."""
    at = HEADER
    while at < len(library) - FOOTER:
        yield at
        at += 8 + struct.unpack_from("<I", library, at + 4)[0]


def forged(library, rng):
    """Returns forged bytes, and True if their checksums are valid."""
    data = bytearray(library)
    way = rng.randrange(7)
    at = rng.randrange(len(data))
    if way == 0:
        data[at] ^= 1 << rng.randrange(8)
        return bytes(data), False
    if way == 1:
        return bytes(data[: rng.randrange(1, len(data))]), False
    if way == 2:
        return rng.randbytes(rng.randrange(1, 4000)), False
    if way == 3:
        # Another version, written as by its builder.
        struct.pack_into("<HH", data, 8, rng.choice([0, 2, 65535]), rng.choice([0, 1, 2, 9]))
    elif way == 4:
        # A byte of a table: manifest, clips, transitions, routes, codes, safe pose, names.
        section = rng.choice(list(sections(library)))
        length = struct.unpack_from("<I", library, section + 4)[0]
        data[section + rng.randrange(min(8 + length, 200))] = rng.randrange(256)
    elif way == 5:
        data[at] = rng.randrange(256)
    else:
        cut = rng.randrange(1, 200)
        del data[max(HEADER, at - cut) : max(HEADER, at)]
    return resealed(data), True


def hostile(library, count, rng):
    """`count` pairs: a library that is not the owner's, and whether its checksums are valid."""
    made = 0
    while made < count:
        data, sound = forged(library, rng)
        if data != library:
            made += 1
            yield data, sound
