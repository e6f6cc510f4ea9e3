"""The page of the loose seats B and C."""

from benchmarks.stability import seats
from benchmarks.stability.judgement import Judged
from benchmarks.stability.page import introduction, summary, table_of

INTRODUCTION = """\
# Stiff and extreme seats

Made by `{command}` in {minutes:.0f} minutes; not edited by hand. {machine}.

![Verdicts by number of a seat, start and formulation](stability_seats.png)

A cell is a motion, its number the steps of a turn in thousands; the errors are in the tables. The
base case is the column A, B, C of the loose joints.

{summary}

Base case: 30 rad/s, A, B and C loose by {clearances} mm, restitution {restitution:g}, friction
{friction:g} with the slip of the surfaces, a load of {load:g} kN along the jaw that keeps the seats
in contact; one number of B (elbow) or of C (pivot) is changed at a time
(csv: [stability_seats.csv](stability_seats.csv)). Centred: all e = e' = 0. In contact: all pins
resting in their bores. Violent: from e = 0, the pin of the seat in question at 5 m/s.

Every motion is compared twice, at the default tolerances, as [those of A](stability.md) are. First
instant by instant over {span:g} ms, force on the foundation and the eccentricities of all loose
joints, with SUNDIALS' CVODE on free bodies and the published laws without smoothing
(`benchmarks/peers/free_bodies_numba.py`, written without jaxcrusher, the same as
`free_bodies.py` to rounding). Allowed: {promised:g} of the largest value, or the errors of the
programs at a contact, times the contacts so far, grown as CVODE's own motions part from starts
{offset:g} m apart; where these exceed {predictable:g} nothing is compared. Then the RMS over turns
{first} to {last} with the same free bodies in a Dormand-Prince program for numba, from {few} starts
1e-5 clearances apart, {many} (and up to {ours} of ours) where they scatter. Verdicts and what the
RMS is allowed are as there. {vague} motions are allowed more than half of their RMS, for starts
part between whirl and quiet there: of these the instants alone tell.

What leaves the contact model, and is said to: seats of 0.01 mm and below and of a hundredth of the
stiffness, whose contacts are too wide for Hertz's theory; seats of 0.5 mm and above, more than a
hundredth of their bore radius; at 8.8 kN and below all, for seats that carry little rattle for good
and faster than impacts stay elastic; at 200 kN and above A, whose contact is too wide. Every whirl
is A's. It throws the pins of B and C round their bores too (remarks), in and out of contact; of
themselves, with A ideal, they do not go on.
"""


def seats_page(rows: list[Judged], minutes: float) -> str:
    """The page in Markdown."""
    lines = [
        introduction(
            INTRODUCTION,
            minutes,
            summary(rows, []),
            clearances=", ".join(f"{1e3 * c:g}" for c in seats.CLEARANCES.values()),
            restitution=seats.LAW["restitution"],
            friction=seats.LAW["friction"],
            load=seats.LOAD / 1e3,
            vague=sum(row.rms_allowed > 0.5 for row in rows),
        )
    ]
    units = {
        f"{seat} {name}": a.unit for seat in seats.SEATS.values() for name, a in seats.AXES.items()
    }
    for axis in dict.fromkeys(row.axis for row in rows):
        unit = {"load": seats.LOADS.unit, **units}.get(axis, "1")
        named = "loose joints" if axis == "loose" else axis
        heading = f"## By {named}, {unit}".removesuffix(", 1")
        lines += [heading, "", *table_of(r for r in rows if r.axis == axis), ""]
    return "\n".join(lines)
