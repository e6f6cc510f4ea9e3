"""The text between the tables of the page, with places for its numbers."""

HEADING = """# Which joint matters

Made by `{command}`; not edited by hand. {setting}.

The seats of the toggle, B on the jaw and C on the frame, wear as well as the main
bearing, A. What does wear of each do to the foundation, and what would show there
which of them is worn?

**Loaded along the jaw, as in the paper, B and C rattle, and the foundation's RMS goes
from {new} kN to {b} kN with 0.5 mm in B and to {c} kN with 0.5 mm in C, but to {a} kN with
0.12 mm in A. Loaded across the jaw, against the toggle, no joint opens, and no such wear
changes the RMS by more than {quiet} %. The force at C tells B from C: of its {bursts_new} bursts a
turn wear in B makes {bursts_b}, and wear in C {bursts_c}; nothing tells A safely.**

![RMS, impacts, bursts of R_C and R_C over R_O against the worn clearance](which_joint.png)

*PE250x400 at 30 rad/s; one joint is worn, the others have {new_mm:g} mm. Load along the
jaw, but for the dashed lines. Bars: two standard errors.*

"""

RATTLES = """## The load along the jaw: B and C rattle

8.8 kN, the paper's load. The force in B and C of the linkage without play nearly
vanishes and turns round within each turn; with play the toggle flies from seat to
seat, and no motion settles. Averages of {starts} starts over {turns} turns, after {settle};
clearances in mm, all three loose. Peak, fastest impact and largest force are the largest
of those turns. "Inside" is inside the contact model.

"""

IMPACTS = """
Fastest impact, largest force, and wear power: the mean of normal force times slip of
the surfaces, to which Archard's wear is proportional.

"""

QUIET = """
Wear in B or C feeds itself: with 0.5 mm in either, the power that wears the two is some
three times that of a new machine. A, with most of the power, wears but a tenth faster.
The blows end in A, whose largest force goes from {a_new:.0f} kN to {a_b:.0f} kN with wear in B: the
worn seat hammers the main bearing, which opens too. More play in A softens the blows.

## The load across the jaw: nothing opens

The same 8.8 kN, square to the jaw, presses the toggle into its seats. The motion
settles in contact, so that `periodic_orbit` has it with exact slopes by each clearance
(N/mm, all three in each row), and the turns in which a disturbance falls to 1/e.

"""

TELLS = """
The slopes say what a wear of 0.01 mm does: two newtons in A, less than a tenth of one in
B or C. At 0.12 mm A is near a resonance of its contact with a multiple of the speed (in
R_O the share above three times the speed is {share_worn}, for {share_new} when new), hence the
other slope; even there the RMS is {resonant:.2f} % off.

## What shows the worn joint

R_O and R_C can be measured apart at the frame. Load along the jaw:

"""

MEANINGS = """
- **That B or C is worn**: the share of the force's variance above three times the speed,
  in R_O and in R_C. It grows with wear in either.
- **B or C**: R_C is nothing while C's pin flies. A worn C is hit less often, for its pin
  flies longer; a worn B makes the toggle strike C more often. With one sample each
  {coarse_ms:.1f} ms, a quarter of these, {coarse_b} and {coarse_c} bursts are left of {bursts_b}
  and {bursts_c}: still apart.
- **B**: the RMS of R_C over that of R_O is higher with a worn B. That needs a measurement
  beyond 1 kHz: up to {low} times the speed the ratio of what varies is
  {low_b} with 0.5 mm in B, and {low_c} with 0.5 mm in C.
- **Both worn out**: as few bursts as with a worn C, and a higher ratio than with either.
- **What does not tell B from C**: RMS, peak and shares, whose values occur with either.
  The ratio of the peaks scatters from start to start nearly as much as it changes.
- **A**: its wear lowers RMS, peak and shares a little, against the machine when new; a
  little wear in B or C hides that.
- Across the jaw none of these shows anything: no bursts, and the same ratios.

"""

ALONE = """## One joint loose, the others ideal

Averages where there is an error, else settled motions. Impact (m/s) and wear power are
those of the loose joint. A alone never rattles; B or C alone rattle, less than with play
in A.

"""

LIMITS = """
## Why tight seats are not ideal seats

Tight B and C with Hertz's stiffness make the first impact at A weaker: 153.9 kN with a
play of 1 um, 181.2 kN with ideal B and C (30 rad/s, 0.06 mm in A, no friction, centred
start). The seats of B and C are two springs in series with A's contact, and only about
twice as stiff; and the force in B turns round in the impact, so that the toggle crosses
its play, however small. Ideal seats are the limit of both: no play and no compliance.
First peak of the force at A, kN, from quiet starts in contact, by stiffness and play of
B and C:

| K, N/m^1.5 | 1 um | 0.1 um | 0.01 um |
|---|---:|---:|---:|
| 6e12, about Hertz's | 154.3 | 155.2 | 155.3 |
| 6e13 | 156.2 | 164.3 | 167.1 |
| 3e14 | 156.8 | 180.6 | 180.7 |

From `benchmarks/peers/free_bodies.py`, free bodies in SciPy; this command does not compute
these again.

## Limits

- Whatever rattles is outside the contact model: impacts above 0.051 m/s are beyond
  the elastic limit of steel, contacts are wider than half a bore radius, or 0.5 mm is more
  than 0.01 of a bore of 40 mm. Read those rows as a ranking, not as forces to design for.
- Friction is the paper's, which reads the slip of the centres. With dry friction of 0.1
  between the surfaces (`--slip surface`, twice the time) rattling from 0.2 mm in B or C on
  throws A's pin into a friction whirl of 18 MN: the column `whirls` counts the starts.
  Starts that do not whirl have an RMS up to 6 % below the one here.
- The frame is rigid, and load cells have no dynamics of their own. Oil, the elastic
  toggle, and the tension rod that holds it in its seats are not in the model; the rod
  would keep B and C closed.
- A's bore has a radius of 130 mm, those of B and C 40 mm; all are steel.
"""
