"""Decodes a candump log by a DBC file with cantools and compares every frame with what the firmware meant.

Usage: check_with_cantools.py FILE.dbc CAPTURE.log MEANT.json

Nothing here knows the firmware's code: layout, scaling and names come from the DBC file alone, and how a parameter
group, a "not available" and a list of troubles look comes from SAE J1939.
"""

import json
import sys

import cantools
from cantools import j1939

TOOL = 0xF9


def group(frame_id):
    """Parameter group number of an identifier, and whether a service tool sent it."""
    parts = j1939.frame_id_unpack(frame_id)
    addressed = parts.pdu_format < 240
    specific = 0 if addressed else parts.pdu_specific
    pgn = parts.reserved << 17 | parts.data_page << 16 | parts.pdu_format << 8 | specific
    return pgn, parts.source_address == TOOL


def all_ones(signal):
    return (1 << signal.length) - 1


def is_error(signal, raw):
    if signal.length >= 8 and signal.length % 8 == 0 and not signal.choices:
        return raw >> (signal.length - 8) == 0xFE
    return raw == all_ones(signal) - 1


def differs(signal, raw, scaled, meant):
    """Why a signal is not what was meant; nothing when it is."""
    if meant is None:
        return None if raw == all_ones(signal) else f"raw {raw:#x} is not 'not available'"
    if isinstance(meant, dict):
        return None if is_error(signal, raw) else f"raw {raw:#x} is not an error"
    if isinstance(meant, str):
        name = str(signal.choices.get(raw)) if signal.choices else None
        return None if name == meant else f"{name!r} instead of {meant!r}"
    # Half a step by rounding, and what single precision leaves of a number of this size.
    allowed = 0.5001 * signal.scale + 2e-7 * abs(meant) if signal.scale != 1 or signal.offset else 0
    return None if abs(scaled - meant) <= allowed else f"{scaled} instead of {meant}"


def troubles(payload):
    """Suspect parameter number, failure mode and occurrences of each trouble of DM1 or DM2 (J1939-73)."""
    found = []
    for at in range(2, len(payload) - 3, 4):
        low, middle, high, count = payload[at : at + 4]
        found.append([low | middle << 8 | (high >> 5) << 16, high & 0x1F, count & 0x7F])
    return found


def main(dbc, log, meant):
    database = cantools.database.load_file(dbc)
    messages = {group(message.frame_id): message for message in database.messages}
    with open(meant, encoding="utf-8") as file:
        wanted = json.load(file)
    with open(log, encoding="utf-8") as file:
        lines = file.read().splitlines()
    complaints = []
    if len(lines) != len(wanted["frames"]):
        complaints.append(f"{len(lines)} frames, {len(wanted['frames'])} meant")
    lists, size, packets = [], 0, {}
    for number, (line, frame) in enumerate(zip(lines, wanted["frames"])):
        identifier, data = line.split()[2].split("#")
        identifier, data = int(identifier, 16), bytes.fromhex(data)
        pgn, by_tool = group(identifier)
        message = messages.get((pgn, by_tool)) or messages.get((pgn, False))
        if message is None:
            complaints.append(f"frame {number}: group {pgn} is not in the file")
            continue
        if message.name != frame["message"]:
            complaints.append(f"frame {number}: {message.name} instead of {frame['message']}")
            continue
        if len(data) != message.length:
            complaints.append(f"frame {number}: {len(data)} bytes")
            continue
        raws = message.decode(data, scaling=False, decode_choices=False)
        values = message.decode(data, scaling=True, decode_choices=False)
        if message.name == "TpConnectionManagement":
            size, packets = raws["TpSize"], {}
        elif message.name == "TpDataTransfer":
            packets[raws["TpSequence"]] = bytes(raws[f"TpByte{place}"] for place in range(1, 8))
            if len(packets) * 7 >= size:
                payload = b"".join(packets[key] for key in sorted(packets))
                lists.append(troubles(payload[:size]))
        elif set(frame["signals"]) != set(raws):
            complaints.append(f"frame {number}: {message.name}: signals {sorted(raws)}")
            continue
        for name, value in frame["signals"].items():
            signal = message.get_signal_by_name(name)
            why = differs(signal, raws[name], values[name], value)
            if why:
                complaints.append(f"frame {number}: {message.name}.{name}: {why}")
    if lists != wanted["lists"]:
        complaints.append(f"lists of troubles {lists} instead of {wanted['lists']}")
    for complaint in complaints[:20]:
        print(complaint)
    if complaints:
        print(f"{len(complaints)} disagreements")
        return 1
    names = sorted({frame["message"] for frame in wanted["frames"]})
    print(f"{len(lines)} frames agree, {len(lists)} lists of troubles, messages: {', '.join(names)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
