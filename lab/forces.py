"""Forces: numbers of the local laws that a plant knows.

Extension x, its rate v, parameters p:

CUBIC       p0 x³ + p1 x²
QUADRATIC   p0 |v| v + p1 v³
BILINEAR    p0 x for x > 0
DEADBAND    -p1 clip(x, -p0, p0): what a spring of stiffness p1 loses by a play of ± p0
STOP        p1 (x - p0) past p0, on the side p2 = ±1
COULOMB     p0 tanh(v / p1), or sign(v) with sticking where p1 = 0
BOUC_WEN    z with ż = p0 v - (|v| z + v |z|) / (2 p1)
DRIFT       p0 s x, s the share of the record that has passed
"""

CUBIC, QUADRATIC, BILINEAR, DEADBAND, STOP, COULOMB, BOUC_WEN, DRIFT = range(8)
KINKED = (BILINEAR, DEADBAND, STOP, COULOMB)
"""Laws whose slope jumps."""
