"""Variables of wheelsets and frames by the number of the wheelset and the letter of the frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fmus.variables import Input, OnTrack, Output, State, Variable, rate

SIDES = ("left", "right")
WHEELSET = {  # coordinate: unit, what it is, nominal of it and of its rate
    "y": ("m", "lateral displacement", 1e-3, 0.02),
    "psi": ("rad", "yaw", 5e-4, 0.01),
}
BODY = WHEELSET | {"phi": ("rad", "roll", 5e-3, 0.02)}
MOTIONS = {"y": "lateral", "psi": "yaw", "phi": "roll"}
PORT = {
    "y": ("F_y", "N", "lateral force"),
    "psi": ("M_z", "N.m", "yaw moment"),
    "phi": ("M_x", "N.m", "roll moment"),
}


def port_name(coordinate: str) -> str:
    """The input by which a force acts on a coordinate such as psi_1."""
    kind, _, where = coordinate.partition("_")
    return f"{PORT[kind][0]}_{where}_ext"


def body_variables(
    coordinates: Mapping[str, tuple[str, str, float, float]], where: str, what: str
) -> dict[str, Variable]:
    """States, accelerations and ports of a body: `where` ends its names, `what` describes it."""
    found: dict[str, Variable] = {}
    for q, (unit, meaning, nominal, fast) in coordinates.items():
        name = f"{q}_{where}"
        speed = State(f"{unit}/s", doc=f"rate of {meaning} of {what}", nominal=fast, name=f"{name}_dot")
        force, force_unit, kind = PORT[q]
        found[name] = State(unit, doc=f"{meaning} of {what}", nominal=nominal)
        found[f"{name}_dot"] = speed
        found[f"{name}_ddot"] = rate(speed, f"{unit}/s2", f"acceleration in {meaning} of {what}")
        found[f"{force}_{where}_ext"] = Input(force_unit, doc=f"port: {kind} on {what}", nominal=1e3)
    return found


def wheelset_variables(number: str, what: str, behind: Sequence[str]) -> dict[str, Variable]:
    """All of one wheelset: states, what it feels of the track, ports, and what its wheels do to the rails.

    behind: parameters by whose sum it runs behind the leading wheelset, m.
    """
    found = body_variables(WHEELSET, number, what)
    found[f"omega_{number}"] = State(
        "rad/s", doc=f"rolling speed of {what} over V/r0", nominal=0.05, name=f"omega_{number}"
    )
    found[f"omega_{number}_dot"] = rate(found[f"omega_{number}"], "rad/s2", f"rolling acceleration of {what}")
    at = tuple(behind)
    felt = {
        "y_irr": ("m", "alignment", 1e-3, 0.02, OnTrack("alignment", behind=at)),
        "kappa": ("1/m", "curvature, positive to the left,", 1e-3, 1e-3, None),
        "cant": ("rad", "cant, positive where the right rail is higher,", 0.02, 0.02, None),
    }
    for q, (unit, meaning, nominal, fast, track) in felt.items():
        name = f"{q}_{number}"
        found[name] = Input(unit, doc=f"{meaning} under {what}", nominal=nominal, on_track=track)
        found[f"{name}_dot"] = Input(
            f"{unit}/s" if unit != "1/m" else "1/(m.s)",
            doc=f"rate along the run of the {meaning} under {what}",
            nominal=fast,
            on_track=track and OnTrack("alignment", rate=True, behind=at),
        )
    for side in SIDES:
        wheel = f"the {side} wheel of {what}"
        found |= {
            f"Y_{number}_{side}": Output(
                "N", doc=f"guiding force of {wheel}, positive outwards", nominal=1e4
            ),
            f"Q_{number}_{side}": Output("N", doc=f"wheel load of {wheel}", nominal=5e4),
            f"YQ_{number}_{side}": Output("1", doc=f"guiding force over wheel load of {wheel}", nominal=0.1),
            f"delta_{number}_{side}": Output("rad", doc=f"contact angle of {wheel}", nominal=0.1),
            f"T_gamma_{number}_{side}": Output(
                "N",
                doc=f"energy that {wheel} dissipates by the way, creep forces times creepages",
                nominal=10.0,
            ),
            f"T_gamma_flange_{number}_{side}": Output(
                "N", doc=f"of it that in contacts at the flange of {wheel}", nominal=10.0
            ),
        }
    return found
