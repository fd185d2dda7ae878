"""The findings of vibration: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.physics.finding_table import FINDINGS as SHARED_FINDINGS

FINDINGS = Kinds.of(
    """
unlikely-eigenfrequency [warning] an eigenfrequency is one that no machine has
    → Check the mass (kg, not g) and the stiffness (N/m, not N/µm).
sharp-resonance [warning] a source shakes at a resonance with little damping
    → Make sure of the dissipation and the stiffness of the joint: they decide how large it is.
no-chain-to-final [info, warning] no chain carries lines of a source to tool or workpiece
    → Add chains from these sources, or take the coupled structure.
chains-off-coupled [info, warning] the chain method differs from the coupled structure
    → believe the coupled structure: chains leave out how members act back on those before them, and what is merged,
      held or cut off
height-beyond-motion [warning] the published height of a periodic error is larger than tool and workpiece move
    → believe the copied motion, unless a measured surface says otherwise
line-beyond-sampling [warning] a line of a source is faster than the sampling carries; it is left out there
    → Sample more often if this line matters.
chatters-at-any-depth [warning] nothing damps a mode: with the law of the cutting force any cut chatters in it
    → Give the joints a dissipation.
run-up-too-quick [warning] a run-up passes a resonance too quickly for the motion to be the steady one
    → Let the frequency change more slowly there.
line-changes-chains [info] a line passes from the chains of one range to those of another: the motion jumps there
    → Simulate a run-up with the coupled structure.
motion-not-compared [info, warning] recorded motions are not known to be of tool or workpiece, and not compared
    → Say in the machine file what they moved: place.
channel-of-nothing [warning] a recorded channel belongs to nothing of the model and does not act
    → Give it the place of its source or shaft in the machine file.
recorded-clock-uneven [warning] the recorded clock is uneven; forces are brought to even times by splines
    → record with an even clock, or give the true one
recorded-rows-lost [info] rows of the clock are missing; they are put in by splines
steady-before-recording [info, warning] recorded forces are taken to have gone on before and after the run as they went
    at its ends
    → leave this stretch out when you compare
input-bridged [warning] an input lacks values; they are put in
    → cut the run to the stretch that is complete if this matters
speed-without-sign [info, warning] a speed is below 0: the shaft is taken to turn as fast the other way
    → Cut the run where the shaft turns round if this matters.
lines-of-the-file [info] recorded forces act, and lines and errors of the surface are those of the model file
    → compare the simulated with the recorded channels, or put what was recorded into the spectra
chains-not-judged [info] chains cannot be judged over all frequencies
    → See what the finding names.
lines-at-mean-speed [info] lines, amplitudes and errors are those of the mean speed; the recording follows the course
    → look at the recording for resonances that the run passes, or give the speed as one number
taps-do-not-see [warning] the taps do not tell a number; the fitted model has a value that goes with the others
    → Tap, or measure, on both sides of the joint, or fit fewer numbers (--free).
tap-fit-at-bound [warning] a fit to taps ended at the bounds of the model file
    → Widen [bounds], or look for what the model lacks: a member, a joint, a unit.
taps-not-reached [warning] no stiffness and ψ make the compliances that the taps measured
    → Check signs, nodes (--point) and units; then narrow --band to the modes that the model has, or add members. Do not
      trust the intervals.
tap-lines-left-out [info] lines outside of the band, or where the taps do not agree, do not count
    → Tap harder, or with another tip, if a mode lies there.
single-tap [info] one spectrum alone: intervals come from what the model leaves of it along the frequency
    → Give the spectra of three taps or more, or the records in time.
"""
)
FINDINGS["recorded-gap"] = SHARED_FINDINGS["recorded-gap"]
FINDINGS["recorded-clock-jitter"] = SHARED_FINDINGS["recorded-clock-jitter"]
FINDINGS["input-not-recorded"] = SHARED_FINDINGS["input-not-recorded"]
