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

#[cfg(test)]
mod tests {
    use super::super::{Scenario, Seeds};
    use crate::registry::Registry;

    fn scenario(sets: &[&str]) -> Scenario {
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        Scenario::open("network/crater-dense", &sets, &Registry::builtin()).unwrap()
    }

    #[test]
    fn a_problem_is_the_same_under_another_seed() {
        let (own, given) = (scenario(&[]), scenario(&["problem_seed=1"]));
        let seeds = |run, problem| Seeds { run, problem };
        assert_eq!(own.seeds_of(5, None), seeds(5, 5));
        assert_eq!(given.seeds_of(5, None), seeds(5, 1));
        assert_eq!(given.seeds_of(5, Some(3)), seeds(5, 3));
    }

    /// What is built is the problem that pictures show: the places of nodes decide where none
    /// hears.
    #[test]
    fn what_is_built_is_the_problem() {
        let scenario = Scenario::open("network/crater-gaps", &[], &Registry::builtin()).unwrap();
        let notes = |run, problem| {
            let assembled = scenario.assemble_seeded(Seeds { run, problem }).unwrap();
            assert!(!assembled.notes.is_empty());
            assembled.notes
        };
        assert_eq!(notes(1, 1), notes(2, 1));
        assert_ne!(notes(1, 1), notes(1, 2));
    }

    /// A run whose problem is its own says nothing of one, and its scenario is as it always was.
    #[test]
    fn seeds_are_written_where_they_say_something() {
        let mut scenario = scenario(&["seed=4"]);
        let before = scenario.resolved().unwrap();
        assert!(!before.contains("problem_seed") && !before.contains("tie_seed"));
        scenario.set_seeds(Seeds { run: 4, problem: 4 });
        assert_eq!(scenario.resolved().unwrap(), before);
        scenario.set_seeds(Seeds { run: 4, problem: 2 });
        scenario.set_tie_seed(9);
        let resolved = scenario.resolved().unwrap();
        assert!(resolved.contains("problem_seed = 2\n") && resolved.contains("tie_seed = 9\n"));
        assert_eq!(scenario.seeds(), Seeds { run: 4, problem: 2 });
    }
}
