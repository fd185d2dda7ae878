"""The fields of a selection's JSON form (`selector.selection/1`) that its report shows, and what each must be."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from selector.findings import Finding, Where

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Perhaps = Number | None
Count = Annotated[int, Field(strict=True, ge=0)]
Names = tuple[str, ...]
ByName = dict[str, Number]


class _Part(BaseModel):
    """A part of the document; fields that a later version adds are not looked at."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class FindingPart(_Part):
    """A finding."""

    id: str
    level: Literal["info", "warning", "error"]
    statement: str
    where: dict[Literal["channel", "run", "from_s", "to_s", "file"], str | Number] = {}
    evidence: dict[str, Any] = {}
    suggestion: str = ""
    action: Literal["none", "leave-out-stretch", "leave-out-run", "leave-out-channel"] = "none"

    def finding(self) -> Finding:
        """As a value."""
        where: dict[str, Any] = {str(key): value for key, value in self.where.items()}
        return Finding(self.id, self.level, self.statement, Where(**where), self.evidence, self.suggestion, self.action)


class RoundPart(_Part):
    """One round of grouping and its representatives."""

    level: Annotated[Number, Field(alias="lambda")]
    groups: tuple[Names, ...]
    representatives: Names


class ScreeningPart(_Part):
    """One way of grouping that was tried."""

    level: Annotated[Number, Field(alias="lambda")]
    lambda_of_rounds: Annotated[tuple[Number, ...], Field(min_length=1)]
    representatives: Names
    f_statistic: Perhaps
    heldout_relative: Perhaps
    chosen: bool


class CombinationPart(_Part):
    """One set of sensors for one response."""

    sensors: Names
    response: str
    r2: Perhaps
    adjusted_r2: Perhaps
    heldout_rmse_um: Perhaps
    origin: str


class ChosenPart(_Part):
    """The chosen sensors and the shape of the model."""

    sensors: Annotated[Names, Field(min_length=1)]
    because: str
    reasons: dict[str, str]
    degree: Annotated[int, Field(ge=1, le=3)]
    interactions: bool
    sensor_taus_s: tuple[Number, ...]
    speed_taus_s: tuple[Number, ...]


class ScaledPart(_Part):
    """A model in the form in which it was fitted."""

    variables: Names
    centre: tuple[Number, ...]
    scale: tuple[Number, ...]
    terms: tuple[dict[str, Annotated[int, Field(ge=1, le=9)]], ...]
    coefficients: tuple[Number, ...]
    covariance: tuple[tuple[Perhaps, ...], ...]
    vif: tuple[Perhaps, ...]


class LagPart(_Part):
    """A memory term."""

    source: str
    tau_s: Number


class RunPart(_Part):
    """Errors on one run, or on one part that was left out."""

    rmse_um: Perhaps = None
    max_um: Perhaps = None
    heldout_rmse_um: Perhaps = None
    heldout_max_um: Perhaps = None
    heldout_mean_um: Perhaps = None
    heldout_samples: Count | None = None
    before_rmse_um: Perhaps = None
    before_max_um: Perhaps = None
    heldout_sensors: Names = ()


class ModelPart(_Part):
    """The model of one response."""

    lags: tuple[LagPart, ...]
    r2: Perhaps
    adjusted_r2: Perhaps
    rmse_um: Perhaps
    per_run: dict[str, RunPart]
    scaled: ScaledPart
    n_samples: Count
    ridge: Number
    condition_number: Perhaps
    durbin_watson: Perhaps
    ljung_box_p: Perhaps
    max_cooks_distance: Perhaps


class PointPart(_Part):
    """Held-out error at one number of sensors."""

    n_sensors: Count
    heldout_rmse_um: dict[str, Perhaps]
    standard_error_um: dict[str, Perhaps]
    per_part_um: tuple[dict[str, Perhaps], ...]


class TracePart(_Part):
    """Courses of one left-out part."""

    run: str
    time_s: Annotated[tuple[Number, ...], Field(min_length=1)]
    measured_um: dict[str, tuple[Perhaps, ...]]
    predicted_um: dict[str, tuple[Perhaps, ...]]


class HullPart(_Part):
    """The hull of the model's inputs; results of earlier versions have none."""

    scale: tuple[Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)], ...]
    points: tuple[tuple[Number, ...], ...]


class ReadingsPart(_Part):
    """Thinned samples of a run; results of earlier versions have none."""

    run: str
    n_samples: Count
    time_s: Annotated[tuple[Number, ...], Field(min_length=1)]
    variables: dict[str, tuple[Number, ...]]
    displacement_um: dict[str, tuple[Number, ...]]
    beyond_others: tuple[Perhaps, ...]


class ProofPart(_Part):
    """What unseen parts of the recording say."""

    left_out: Literal["run", "condition", "block"]
    curve: tuple[PointPart, ...]
    baselines_um: dict[str, dict[str, Perhaps]]
    traces: tuple[TracePart, ...]


class FaultPart(_Part):
    """What faults of one sensor do."""

    sensor: str
    response: str
    per_kelvin_um: Perhaps
    stuck_um: Perhaps
    open_um: Perhaps


class OptionsPart(_Part):
    """What was asked."""

    responses: Names
    level: Annotated[Literal["auto"] | tuple[Number, ...], Field(alias="lambda")]
    rounds: int
    max_sensors: int
    degree: int
    interactions: bool
    memory: bool
    reference: Literal["rise", "absolute"]
    absolute_similarity: bool
    must: Names
    never: Names
    cost: ByName
    tolerance: Perhaps
    ridge: bool
    conditions: dict[str, str]
    seed: int


class SelectionDocument(_Part):
    """The fields of a selection's JSON that its report shows."""

    sensors: Annotated[Names, Field(min_length=1)]
    similarity: tuple[tuple[Number, ...], ...]
    level: Annotated[Number, Field(alias="lambda")]
    lambda_because: str
    rounds: Annotated[tuple[RoundPart, ...], Field(min_length=1)]
    screenings: tuple[ScreeningPart, ...]
    combinations: tuple[CombinationPart, ...]
    chosen: ChosenPart
    valid_range: dict[str, tuple[Number, Number]]
    hull: HullPart | None = None
    readings: tuple[ReadingsPart, ...] = ()
    models: Annotated[dict[str, ModelPart], Field(min_length=1)]
    proof: ProofPart
    faults: tuple[FaultPart, ...]
    stability: dict[str, Perhaps]
    options: OptionsPart
    provenance: dict[str, Any]
    findings: tuple[FindingPart, ...]
