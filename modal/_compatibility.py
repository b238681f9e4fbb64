"""The names of version 0.1.0, and a warning about another distribution's package called `modal`.

Old names and module paths work for one version, with a DeprecationWarning.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterable
from functools import wraps
from importlib import import_module
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

NAMESAKE = (
    "the distribution 'modal' (the Modal cloud client) is installed beside 'multipendula' in {place}; both own the "
    "import name 'modal' and overwrite each other's files: give each its own virtual environment"
)
OVERWRITTEN = (
    "the package 'modal' in {place} is not multipendula's, or not whole: the Modal cloud client, whose distribution is "
    "called 'modal' too, was installed over it or removed with files of it; give each its own virtual environment, or "
    "mend this one: pip uninstall modal multipendula, then install multipendula again"
)

MOVED = {
    "modal.assembly": "linear=linearization rig=arrays",
    "modal.coupling": (
        "coupling_records=records coupling_words=report damping_words=report decay=damping dynamic_mass "
        "family_words=report feeding=damping own_modes=fixed_base talk=exchange talk_words=report"
    ),
    "modal.eigen": (
        "amplitude bisect=bisection built=counts chain=recursion coincident=degenerate crowd=coupled "
        "damped=quadratic dense effective=chains matrix_source routes=spectrum secular sources spectrum "
        "sprung_chain=sprung_chains"
    ),
    "modal.exact": (
        "balls certified=enclosures integer_polynomials=polynomials isolation=roots polynomials=characteristic "
        "sprung=characteristic"
    ),
    "modal.exports": (
        "names=identifiers exports.c_text=c exports.control_=objects exports.fmu_description=fmu exports.m=matlab "
        "exports.mat=matlab exports.scipy_=objects"
    ),
    "modal.loci": "encounters=crossings loci_tables=following tracks=tracking",
    "modal.modes": (
        "all_shapes=modes audit=solution_report closed_forms families=labels matrix_tables=tables mode numbering "
        "resonances=mode sensitivity shapes tables"
    ),
    "modal.plotting": (
        "cart_mass_figures=coupling coupling_figures=coupling dress=layout figures=shapes loci_figures=loci "
        "mass_figures=coupling palette=style pictures=style response_figures=response sliders"
    ),
    "modal.report": "escaping prose",
    "modal.scene": "drives=links files messages=validation places=parameters sealed validation variations=parameters",
    "modal.statespace": "balancing exports.discrete=sampling gains modal_form reduction response shapers signals",
    "modal.symbolic": (
        "derivation displayed=line_breaks eigen_polynomials=eigen eigen_sections=eigen kinetic lagrange lagrangian "
        "papers polynomial_roots=roots sections=typesetting targets=derivation typeset=typesetting"
    ),
    "modal.symbolic.papers": (
        "catalogue papers.cart=cart papers.cart_dae=cart_dae papers.planar=planar papers.spatial=spatial "
        "papers.spatial_azimuth=spatial_azimuth"
    ),
    "nonlinear": "recordings=files saved_files=files",
    "nonlinear.accuracy": (
        "advice advice_tables=tables attempts ladder=candidates references shortcuts=attempts "
        "tradeoff=work_precision tradeoff_tables=tables"
    ),
    "nonlinear.averaging": "averaged=equations configurations=equilibria describing prediction slow_motion=slow_flow",
    "nonlinear.chaos": "chaos_claims=claims chaos_studies=studies lyapunov tangent",
    "nonlinear.dynamics": (
        "ball_joints=spatial_joints banded compiled constraints=maximal efforts=joints forces=mechanics "
        "hamiltonian interrupts joints maximal mechanics minimal plane=recursion reduced=symmetries saddle=maximal "
        "short=dense small=dense space=spatial_recursion spatial suspended=minimal symmetries"
    ),
    "nonlinear.integration": (
        "escapements integrate=driver methods preparation=run requests=arguments steppers taylor timescales "
        "trajectory twins"
    ),
    "nonlinear.plotting": (
        "animation branch_figures=branches chaos_figures=chaos check_figures=verification figures=run "
        "film=animation gauges=artists scenery=artists stage=scene strobe=animation sweep_figures=sweeps "
        "sync_figures=synchronization tradeoff_figures=work_precision"
    ),
    "nonlinear.postprocessing": (
        "frames=resampling inventory=summary lines=frequencies reactions=reaction_forces smoothing=averages "
        "spectra summary"
    ),
    "nonlinear.reduction": "defect modal_coordinates residual superposition truncated truncation two_planes",
    "nonlinear.ensembles": "cluster crews=executors sweeps.cluster=cluster sweeps.executors=executors",
    "nonlinear.sweeps": (
        "journals=checkpoint locks measure=measures measures modal_measures=measures "
        "run_measures=measures studies=study sweep_files=files sweep_tables=running sync_measures=measures"
    ),
    "nonlinear.synchronization": (
        "agreement=patterns branch_tables=report branches=continuation continuation phases survival=modal_energy "
        "sync_records=report sync_words=report synchrony=study"
    ),
    "nonlinear.system": "directions events excitation=system plant=system starts=initial state",
    "nonlinear.verification": (
        "check=modes check_tables=tables compare=motion compare_tables=tables measurements=measurement"
    ),
}
"""The modules of a room by their old names, and their new ones where these differ."""

RENAMED = {
    "modal.coupling.analysis": "explained=explain",
    "modal.coupling.damping": "strengths=negative_damping",
    "modal.coupling.exchange": "Exchange=Transfer exchange=transfer Talk=EnergyExchange talks=energy_exchanges",
    "modal.coupling.fixed_base": "OwnModes=FixedBaseModes own_modes=fixed_base_modes conservative=without_damping",
    "modal.coupling.records": "records=coupling_record",
    "modal.coupling.report": "words=coupling_report",
    "modal.eigen.coupled": "Crowd=CoupledPendula",
    "modal.eigen.degenerate": "Clusters=DegenerateModes clusters=degenerate_modes",
    "modal.eigen.spectrum": "spectrum=find_spectrum",
    "modal.exact.characteristic": "sampled=sample_at_integers",
    "modal.exact.enclosures": "enclosures=enclose",
    "modal.exact.roots": "isolated=isolate",
    "modal.loci.crossings": "Encounter=CloseApproach encounters=find_close_approaches",
    "modal.loci.following": "loci=follow_loci",
    "modal.loci.tracking": "solved=solve_at followed=follow",
    "modal.modes.shapes": "expanded=expand checked_normalisation=validate_normalisation",
    "modal.modes.solution_report": "Audit=SolutionReport audit=report_solution",
    "modal.scene.files": "shipped=example_names shipped_text=example_text",
    "modal.scene.model": "Start=InitialCondition insist_scene=validate_scene described=describe",
    "modal.scene.parameters": (
        "parsed=parse_variations insist=validate_variations places=find_places written=with_numbers varied=vary"
    ),
    "modal.statespace.balancing": "balanced=balance",
    "modal.statespace.modal_form": "modal_form=to_modal_form",
    "modal.statespace.reduction": "truncated=truncate folded=fold_equals",
    "modal.statespace.sampling": "sampled=sample",
    "modal.statespace.signals": "Push=InputGroup Reading=OutputGroup checked=validate_signals",
    "modal.symbolic.derivation": "derivation=derive",
    "modal.symbolic.lagrangian": "lagrangian=derive_lagrangian",
    "modal.symbolic.roots": "roots=polynomial_roots",
    "modal.symbolic.system": "System=SymbolicSystem",
    "nonlinear.accuracy.advice": "advised=seek_accuracy",
    "nonlinear.accuracy.candidates": "Rung=Candidate ladder=list_candidates",
    "nonlinear.accuracy.references": "references=choose_references",
    "nonlinear.accuracy.work_precision": "Tradeoff=WorkPrecision tradeoff=measure_work_precision measured=measure",
    "nonlinear.averaging.equations": "Averaged=AveragedEquations averaged=average",
    "nonlinear.averaging.equilibria": (
        "Configuration=RelativeEquilibrium configurations=relative_equilibria configuration=relative_equilibrium"
    ),
    "nonlinear.averaging.prediction": "predicted=predict",
    "nonlinear.averaging.slow_flow": "SlowMotion=SlowFlow settled=settle",
    "nonlinear.chaos.studies": "compared=compare_starts",
    "nonlinear.dynamics.equilibrium": "rests_unstably=is_unstable_equilibrium",
    "nonlinear.dynamics.spatial": "Recursion=SpatialRecursion",
    "nonlinear.dynamics.symmetries": "symmetries=find_symmetries symmetrized=symmetrize",
    "nonlinear.integration.arguments": (
        "gathered=validate sampled=sample_times insist_numbers=validate_numbers insist_accuracy=validate_accuracy "
        "insist_seen=validate_observable insist_push=validate_forces"
    ),
    "nonlinear.integration.run": "prepared=prepare",
    "nonlinear.integration.taylor": "equations=expressions",
    "nonlinear.integration.timescales": "timescales=estimate_timescales",
    "nonlinear.integration.trajectory": "Run=SolverInfo",
    "nonlinear.plotting.animation": "strobed=strobe",
    "nonlinear.postprocessing.averages": "smoothed=smooth",
    "nonlinear.postprocessing.reaction_forces": "reactions=reaction_forces_of",
    "nonlinear.postprocessing.resampling": "resampled=resample",
    "nonlinear.postprocessing.summary": "inventory=run_inventory",
    "nonlinear.reduction.residual": "residual=residual_forces",
    "nonlinear.reduction.superposition": "superposed=superpose",
    "nonlinear.reduction.truncation": "truncated=simulate_truncated surveyed=survey_modes",
    "nonlinear.reduction.two_planes": "joined=join",
    "nonlinear.simulation": "resumed=resume",
    "nonlinear.sweeps.checkpoint": "Journal=Checkpoint journal=open_checkpoint",
    "nonlinear.ensembles.executors": "Crew=WorkerPool",
    "nonlinear.sweeps.measures": "asked=parse_measures Asked=RequestedMeasure",
    "nonlinear.sweeps.study": "measured=measure_points",
    "nonlinear.synchronization.continuation": "branches=follow_branches",
    "nonlinear.synchronization.modal_energy": "survival=find_survival",
    "nonlinear.synchronization.report": "records=sync_record",
    "nonlinear.synchronization.study": (
        "theory_of=theory_of_scene synchrony=study_synchronization Synchrony=SynchronizationStudy"
    ),
    "nonlinear.system.directions": "directions=unit_vectors",
    "nonlinear.system.events": "Happening=EventRecord crossing=level_crossing turning=turning_point",
    "nonlinear.system.initial": "released=state_at_rest start_of=initial_state checked=validate_state",
    "nonlinear.system.state": "Push=AppliedForces",
    "nonlinear.system.system": "Plant=System plant_of=system_of",
    "nonlinear.verification.measurement": "measured=measure_mode",
}
"""The exports of a module by their old names and their new ones."""


def renamed(old: str, home: str) -> Callable[[str], Any]:
    """The `__getattr__` of the former module `old`: it finds old and new names of `home`, else AttributeError."""

    def find(name: str) -> Any:
        new = dict(pair.split("=") for pair in RENAMED.get(home, "").split()).get(name, name)
        if not name.startswith("__") and hasattr(found := import_module(home), new):
            warn_of_old_name(f"{old}.{name}", f"{home}.{new}")
            return getattr(found, new)
        raise AttributeError(f"module {old!r} has no attribute {name!r}", name=name, obj=sys.modules.get(old))

    return find


def exported(
    package: str, names: dict[str, str], homes: tuple[str, ...] = (), later: dict[str, str] | None = None
) -> Callable[[str], Any]:
    """The `__getattr__` of a package: it loads exports from `homes`, and accepts the old ones of these names.

    Those `later`, by their rooms, need SciPy: `import *` leaves them out.
    """

    def find(name: str) -> Any:
        offering = sys.modules[package]
        if name in homes:
            return import_module(f"{package}.{name}")
        if homes and name in offering.__all__:
            return next(found[name] for home in homes if name in (found := vars(find(home))))
        if name in (later or {}):
            return getattr(import_module(f"{package}.{later[name]}"), name)  # type: ignore[index]
        if name not in names:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=offering)
        warn_of_old_name(f"{package}.{name}", f"{package}.{names[name]}")
        return getattr(offering, names[name])

    return find


def warn_of_old_name(old: str, new: str) -> None:
    """Warn with the position of the caller's caller."""
    warnings.warn(f"{old} is {new} now; the old name goes with the next version", DeprecationWarning, stacklevel=3)


def former(owner: str, old: str, new: str) -> Any:
    """A property of the class `owner` that still works under its old name."""

    def get(self: Any) -> Any:
        warn_of_old_name(f"{owner}.{old}", f"{owner}.{new}")
        return getattr(self, new)

    return property(get, doc=f"The old name of `{new}`.")


def former_argument(old: str, new: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A decorator for a function that still accepts a keyword by its old name."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def call(*given: P.args, **named: P.kwargs) -> R:
            if old in named:
                warn_of_old_name(f"{function.__name__}({old}=…)", f"{new}=…")
                named[new] = named.pop(old)
            return function(*given, **named)

        return call

    return decorate


def _moved() -> dict[str, str]:
    """New paths of modules by their old ones."""
    found = {}
    for room, names in MOVED.items():
        for one in names.split():
            old, _, new = one.partition("=")
            package = room.partition(".")[0]
            found[f"{package}.{old}"] = f"{room}.{new or old.rpartition('.')[2]}"
    return found


class _Finder:
    """Modules under their old paths, where no other module has that name."""

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if fullname.partition(".")[0] not in {"modal", "nonlinear"} or fullname not in _moved():
            return None
        return ModuleSpec(fullname, self, is_package=fullname == "modal.papers")  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> None:
        """The default module."""

    def exec_module(self, module: ModuleType) -> None:
        module.__dict__["__getattr__"] = renamed(module.__name__, _moved()[module.__name__])


def warn_about_namesake(search: Iterable[str] | None = None) -> None:
    """Warn if the Modal cloud client is installed on the import path, which overwrites this package."""
    for place in sys.path if search is None else search:
        if place and any(Path(place).glob("modal-*.dist-info")):
            warnings.warn(NAMESAKE.format(place=place), UserWarning, stacklevel=3)
            return


def require_own_package(package: ModuleType) -> None:
    """ImportError with the way out unless the source of `modal` is multipendula's."""
    spec = package.__spec__
    read = getattr(spec and spec.loader, "get_data", None)
    if not (spec and spec.origin and read and b"natural_modes" in read(spec.origin)):
        raise ImportError(OVERWRITTEN.format(place=next(iter(package.__path__), "")))


require_own_package(sys.modules["modal"])
sys.meta_path.append(_Finder())
