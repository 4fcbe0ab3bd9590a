"""The experiments of Liu et al. 2023 and further ones, each one module with a function `run`."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from ..errors import needed_by
from .findings import Figure, Findings, Progress, Setting, Table

__all__ = [
    "EXPERIMENTS",
    "Figure",
    "Findings",
    "Progress",
    "Setting",
    "Table",
    "experiment_names",
    "run_experiments",
]

#: Module of each experiment, in the order of the report. A new one is its file and a line here.
EXPERIMENTS: dict[str, str] = {
    "noise": "noise_points",
    "layers": "layered",
    "repetition": "repetition",
    "scenes": "scenes",
    "similarity": "similarity",
    "two_corners": "two_corners",
    "success": "success",
    "all_methods": "all_methods",
    "repeatability": "repeatability",
    "tracking": "tracking",
    "real": "real",
    "aims": "optimal_aims",
}

#: The paper's names of figures and tables, and the experiment that each is part of.
ALIASES = {
    "fig2": "noise",
    "fig3": "noise",
    "fig5": "layers",
    "fig9": "repetition",
    "fig9a": "repetition",
    "fig9b": "repetition",
    "fig10": "layers",
    "fig11": "scenes",
    "fig12": "similarity",
    "fig13": "two_corners",
    "table2": "two_corners",
    "table3": "success",
    "methods": "all_methods",
}


def experiment_names(names: Iterable[str]) -> list[str]:
    """Tell the experiments that are asked for, by their own names or the paper's, in order.

    Parameters
    ----------
    names : iterable of str
        Names of `EXPERIMENTS` or of `ALIASES`; none asks for all.

    Raises
    ------
    ValueError
        If there is no such experiment.

    Examples
    --------
    >>> experiment_names(["fig5", "fig2", "fig3"])
    ['noise', 'layers']
    """
    chosen = set()
    for name in names:
        experiment = ALIASES.get(name, name)
        if experiment not in EXPERIMENTS:
            known = [*EXPERIMENTS, *(a for a, e in ALIASES.items() if e in EXPERIMENTS)]
            raise ValueError(f"experiment {name!r} is unknown, expected one of: {', '.join(known)}")
        chosen.add(experiment)
    return [name for name in EXPERIMENTS if name in chosen or not chosen]


def run_experiments(
    names: Iterable[str], setting: Setting, progress: Progress
) -> dict[str, Findings]:
    """Run some experiments.

    Parameters
    ----------
    names : iterable of str
        As for `experiment_names`; none asks for all.
    setting : Setting
        Number of frames, seed, and where the recordings are.
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
    with needed_by("reproduce"):  # now, not when half of the experiments are done
        import_module("scipy")
    findings = {}
    for k, name in enumerate(chosen, 1):
        module = import_module(f".{EXPERIMENTS[name]}", __name__)

        def tell(about: str, where: str = f"{name} ({k}/{len(chosen)})") -> None:
            progress(f"{where}: {about}")

        tell("starting")
        findings[name] = module.run(setting, tell)
    return findings
