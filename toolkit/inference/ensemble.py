"""emcee's sampler without what it does to every single number at every step, which took longer than the walk itself."""

from __future__ import annotations

import emcee

from toolkit.records import Floats


class Ensemble(emcee.EnsembleSampler):  # type: ignore[misc]  # emcee has no types
    """For a density of all walkers at once, that is a number at every place and has no blobs.

    It goes on with its own generator, and does not copy that one's state (2.5 kB) for a chain to be resumed from.
    """

    def compute_log_prob(self, coords: Floats) -> tuple[Floats, None]:
        """The log density (K,) of places (K, D), and no blobs."""
        return self.log_prob_fn(coords), None

    @property
    def random_state(self) -> None:
        """Nothing, which emcee takes for the state that the generator is in."""

    @random_state.setter
    def random_state(self, state: object) -> None:
        if state is not None:
            emcee.EnsembleSampler.random_state.fset(self, state)
