//! The seeds of a scenario's run: of the run itself, of its problem, of its ties.

use farside_actors::system::Seeds;

use super::Scenario;

impl Scenario {
    /// The seeds that the scenario gives.
    pub fn seeds(&self) -> Seeds {
        self.seeds_of(self.shared.seed, None)
    }

    /// The seeds of a run with another seed than the scenario's, of the given problem; without one,
    /// of the scenario's, which is that of the run where it says none.
    pub fn seeds_of(&self, run: u64, problem: Option<u64>) -> Seeds {
        Seeds {
            run,
            problem: problem.or(self.shared.problem_seed).unwrap_or(run),
        }
    }

    /// Replaces the seed, as `--seed` does.
    pub fn set_seed(&mut self, seed: u64) {
        self.shared.seed = seed;
    }

    /// Replaces the seed of the run and that of its problem, as studies do. What the scenario says,
    /// and the log of its run, is then enough to run it again.
    pub fn set_seeds(&mut self, seeds: Seeds) {
        self.shared.seed = seeds.run;
        let apart = seeds.problem != seeds.run || self.shared.problem_seed.is_some();
        self.shared.problem_seed = apart.then_some(seeds.problem);
    }

    /// Replaces the seed of ties, as `--tie-seed` does.
    pub fn set_tie_seed(&mut self, tie_seed: u64) {
        self.shared.tie_seed = Some(tie_seed);
    }
}
