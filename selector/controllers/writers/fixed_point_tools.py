"""Functions in C that fixed-point programs call, by their names."""

from __future__ import annotations

TOOLS = {
    "shifted": """\
static int64_t shifted(int64_t value, int bits)
{
    int64_t half = ((int64_t)1 << bits) >> 1;
    return value >= 0 ? (value + half) >> bits : -((-value + half) >> bits);
}
""",
    "limited": """\
static int64_t limited(int64_t value, int64_t low, int64_t high)
{
    return value < low ? low : value > high ? high : value;
}
""",
    "scaled": """\
/* nm from nm/m times um */
static int64_t scaled(int64_t product)
{
    return (product >= 0 ? product + 500000 : product - 500000) / 1000000;
}
""",
    "followed": """\
/* level + (target - level) * dt / (tau + dt), without an intermediate value beyond 64 bits */
static int64_t followed(int64_t level, int64_t target, int64_t dt, int64_t tau)
{
    int64_t change = target - level;
    int64_t all = tau + dt;
    int64_t rest = change % all * dt;
    rest += rest >= 0 ? all / 2 : -(all / 2);
    return level + change / all * dt + rest / all;
}
""",
    "filled": """\
/* over a standstill in 16 steps: one would keep a fifth of a memory of which 2 % are left */
static int64_t filled(int64_t level, int64_t target, int64_t dt, int64_t tau)
{
    int k;
    for (k = 0; k < 16; k++)
        level = followed(level, target, dt / 16, tau);
    return level;
}
""",
    "slope_left": """\
/* nm/m that nm leave over um of the axis */
static int64_t slope_left(int64_t nm, int64_t um, int64_t most)
{
    return um > 0 ? limited(nm * 1000000 / um, 0, most) : 0;
}
""",
    "moved": """\
/* no faster than slew [pm/s]; what is less than 1 nm waits for the next call */
static int32_t moved(int32_t now, int32_t aim, int64_t slew, int32_t dt, int32_t *rest)
{
    int64_t allowed = slew * dt + *rest;
    int64_t most = allowed / 1000000;
    *rest = (int32_t)(allowed % 1000000);
    return (int32_t)limited(aim, now - most, now + most);
}
""",
}
