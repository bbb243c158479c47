//! Anytime max-plus, in a local form. Vlassis, Elhorst and Kok (*Anytime algorithms for multiagent
//! decision making using coordination graphs*, 2004) add up the utility of each iteration's joint
//! assignment along a spanning tree, and keep the best. A tree over all nodes takes messages as far
//! as the network is wide. Here each node judges for itself: what its own rovers' paths of an
//! iteration are worth, alone, together, and with the paths that its neighbours announced for the
//! same iteration, and keeps its own best. That takes one-hop messages only. For the rovers of one
//! node it is exact; two nodes may keep different iterations, and their paths then need not fit.

use super::edge::Edge;
use super::{Agent, first_best, place_of};
use crate::max_plus::candidates::CandidatePath;

/// The paths are places in each rover's list.
#[derive(Debug)]
pub(super) struct Anytime {
    /// The path of each agent, as it was last announced; the own ones' as last chosen.
    paths: Vec<usize>,
    own: usize,
    /// Something was chosen, and not yet judged.
    fresh: bool,
    /// The best own paths so far, and what they were worth.
    best: Option<(f64, Vec<usize>)>,
}

/// What a rover would do if it were alone: its path before any message.
fn alone(paths: &[CandidatePath]) -> usize {
    let payoffs: Vec<f32> = paths.iter().map(|path| path.payoff).collect();
    first_best(&payoffs)
}

impl Anytime {
    pub(super) fn new<'a>(own: impl Iterator<Item = &'a [CandidatePath]>, count: usize) -> Self {
        Anytime {
            paths: own.map(alone).collect(),
            own: count,
            fresh: false,
            best: None,
        }
    }

    /// A neighbour's rover takes part. Until it is heard of it does as if it were alone.
    pub(super) fn expect(&mut self, paths: &[CandidatePath]) {
        self.paths.push(alone(paths));
        // What was judged without it says nothing now.
        self.best = None;
    }

    pub(super) fn announced(&mut self, agent: usize, path: usize) {
        self.paths[agent] = path;
    }

    /// The own rovers' paths in this iteration.
    pub(super) fn choose(&mut self, own: impl Iterator<Item = usize>) {
        for (kept, path) in self.paths.iter_mut().zip(own) {
            *kept = path;
        }
        self.fresh = true;
    }

    pub(super) fn chosen(&self) -> impl Iterator<Item = usize> {
        self.paths[..self.own].iter().copied()
    }

    /// Keeps what was chosen last if it is the best so far, of equals the latest.
    pub(super) fn judge(&mut self, agents: &[Agent], edges: &[Vec<Edge>]) {
        if !std::mem::take(&mut self.fresh) {
            return;
        }
        let own = &self.paths[..self.own];
        let worth = self.worth(own, agents, edges);
        if self.best.as_ref().is_none_or(|(best, _)| worth >= *best) {
            self.best = Some((worth, own.to_vec()));
        }
    }

    /// The best of what was kept, what was chosen last, and `last`; of equals the latest.
    pub(super) fn best(
        &self,
        last: Vec<usize>,
        agents: &[Agent],
        edges: &[Vec<Edge>],
    ) -> Vec<usize> {
        let mut best = (self.worth(&last, agents, edges), last);
        if self.fresh {
            let own = &self.paths[..self.own];
            let worth = self.worth(own, agents, edges);
            if worth > best.0 {
                best = (worth, own.to_vec());
            }
        }
        match &self.best {
            Some((worth, kept)) if *worth > best.0 => kept.clone(),
            _ => best.1,
        }
    }

    /// The share of Q (equation 1) that the own rovers have part in.
    fn worth(&self, own: &[usize], agents: &[Agent], edges: &[Vec<Edge>]) -> f64 {
        let mut worth = 0.0;
        for (i, &path) in own.iter().enumerate() {
            worth += f64::from(agents[i].paths()[path].payoff);
            // A pair of own rovers counts once.
            for j in (0..agents.len()).filter(|&j| j > i) {
                let other = own.get(j).copied().unwrap_or(self.paths[j]);
                worth += f64::from(edges[i][place_of(i, j)].payoff(path, other));
            }
        }
        worth
    }
}
