"""The experiments of Liu et al. 2023 and further ones: a module each, with its `EXPERIMENT`."""

from collections.abc import Iterable
from importlib import import_module

from .experiment import Experiment
from .findings import Figure, Findings, Progress, Setting, Table

__all__ = [
    "EXPERIMENTS",
    "Experiment",
    "Figure",
    "Findings",
    "Progress",
    "Setting",
    "Table",
    "experiment",
    "experiment_names",
    "run_experiments",
]

#: Module of each experiment, in the order of the report, and the paper's names of its results.
EXPERIMENTS: dict[str, tuple[str, ...]] = {
    "definitions": ("fig1", "fig4", "fig6", "fig7", "fig8", "table1"),
    "noise": ("fig2", "fig3"),
    "layers": ("fig5", "fig10"),
    "repetition": ("fig9", "fig9a", "fig9b"),
    "scenes": ("fig11",),
    "similarity": ("fig12",),
    "two_corners": ("fig13", "table2"),
    "sensitivity": ("open",),
    "success": ("table3",),
    "all_methods": ("methods",),
    "plans": (),
    "fits": (),
    "tracking": (),
    "real": ("repeatability",),
    "museum": (),
}


def experiment_names(names: Iterable[str]) -> list[str]:
    """Return the experiments with these names, or the paper's names, in order; no name: all.

    Raises
    ------
    ValueError
        If there is no such experiment.

    Examples
    --------
    >>> experiment_names(["fig5", "fig2", "fig3"])
    ['noise', 'layers']
    """
    of = {other: name for name, others in EXPERIMENTS.items() for other in (name, *others)}
    asked = list(names)
    for name in asked:
        if name not in of:
            known = [*EXPERIMENTS, *(other for other in of if other not in EXPERIMENTS)]
            raise ValueError(f"experiment {name!r} is unknown, expected one of: {', '.join(known)}")
    chosen = {of[name] for name in asked}
    return [name for name in EXPERIMENTS if name in chosen or not chosen]


def run_experiments(
    names: Iterable[str], setting: Setting, progress: Progress
) -> dict[str, Findings]:
    """Run some experiments, the simulated ones with each seed of the setting.

    Numbers, texts and tables that differ between the seeds have median and range: see `Spread`.

    Parameters
    ----------
    names : iterable of str
        As for `experiment_names`.
    setting : Setting
    progress : callable
        Called every second or two with a few words on what is being done.

    Returns
    -------
    dict of str to Findings
        By the name of the experiment, in the order of `EXPERIMENTS`.

    Raises
    ------
    ValueError
        If there is no such experiment.
    """
    chosen = experiment_names(names)
    return {
        name: experiment(name).run(setting, progress, f"{name} ({k}/{len(chosen)})")
        for k, name in enumerate(chosen, 1)
    }


def experiment(name: str) -> Experiment:
    """Return what an experiment declares, from the module of its name."""
    declared: Experiment = import_module(f".{name}", __name__).EXPERIMENT
    return declared
