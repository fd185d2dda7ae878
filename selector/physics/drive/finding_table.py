"""The findings of feed drives: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.physics.finding_table import FINDINGS as SHARED_FINDINGS

UNSTABLE_LOOP = "unstable-loop"

FINDINGS = Kinds.of(
    """
ball-bar-single-feed [info] at one feed, lag of the drives, the bar's length and a scale error change the radius alike
    → Run the circle at a second feed, three times faster or more.
ball-bar-unexplained [warning] part of a ball-bar trace follows none of the causes and is not noise
    → Look at the polar plot: vibration, stick-slip and lateral play are not among the causes.
ball-bar-narrow-spike [warning] something at the reversals of an axis is too narrow for the samples to be told
    → Sample more often, or run the circle more slowly.
ball-bar-rotary-lag-hidden [info] lag of a rotary axis moves the ball across the bar and does not show
    → Set the ball a quarter turn from the bar (table_ball, angle).
ball-bar-set-up-turns [info] what the set-up of a ball on a rotary axis is off looks like another length or centre
    → Take the radius at standstill as that of set-up, bar and mean scale together.
ball-bar-alike [warning] causes cannot be told apart on this circle and are left out
    → Choose another ratio of the rotary axis.
nothing-added [info] the recording lacks a channel that the model file names as added to the output of the control
    → nothing, if this recording was made without it; else let the machine file name it
channel-not-used [warning] nothing was done with a recorded force or output: the simulation is without it
    → Name it under recorded of its axis: load for a force on the table, added for what is added to the output of the
      control.
axis-not-driven [warning] an axis was not simulated: the recording lacks what drives it
    → Name its channels under recorded of the axis.
unstable-loop [error] a control loop is unstable
    → Lower its gains.
little-stability-margin [warning] the position loop is stable with little margin
    → It swings after every change: lower the gains.
breakaway-below-sliding [warning] breakaway friction is below sliding friction: friction rises with the speed
    → exchange static_n and coulomb_n, or leave static_n out
ripple-beyond-force [warning] a force ripple is larger than the force of the actuator
    → give its amplitude as a share: 0.02 for 2 %
limit-reached [info, warning] a limit of the servo is reached
    → Ask for less speed or acceleration, or raise the limit.
faster-than-speed-limit [warning] an axis is asked for more speed than it has: it falls behind
    → ask for a lower feed, or raise servo.speed_limit
begins-in-motion [info] a motion begins while the axis stands: first it catches up
    → Look at the error after the first moments, or let the motion begin at rest.
table-off-the-screw [error] the table goes further than the nut can
    → move less, or correct length_mm and origin_mm of the screw
stick-slip [info] the table sticks and slips
    → go faster, stiffen the screw, or let the breakaway friction be nearer to the sliding one
coarse-step [warning] the step of the calculation is long for the fastest vibration: it is damped
    → Take a smaller run.step_s, or leave it out.
bristles-make-energy [warning] the bristles of a LuGre friction are damped so much that they can drive
    → Take less damping of the bristles.
"""
)
for id_ in ("channel-undecided", "output-not-recorded", "unlikely-value", "recorded-clock-jitter"):
    FINDINGS[id_] = SHARED_FINDINGS[id_]
