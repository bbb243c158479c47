//! What a rover keeps of the ways that it has taken, with `network.takeover_after`: whoever takes over for a
//! node asks for them.

use super::messages::{Walk, Way};

/// A rover's durable memory of its ways, in order; each begins where the one before ends.
#[derive(Debug, Default)]
pub(crate) struct Ways(Vec<Way>);

impl Ways {
    pub(crate) fn has(&self, walk: &Walk) -> bool {
        self.0.iter().any(|way| way.walk == *walk)
    }

    /// Takes a way, which goes on from the step with which it begins.
    pub(crate) fn take(&mut self, way: Way) {
        for before in &mut self.0 {
            let keeps = way.first_step.saturating_sub(before.first_step);
            before.visits.truncate(keeps as usize);
        }
        self.0.push(way);
        self.0.retain(|way| !way.visits.is_empty());
    }

    /// The ways that a rover that has done `step` has not driven to their ends. Those it has are
    /// forgotten.
    pub(crate) fn left(&mut self, step: u32) -> &[Way] {
        self.0
            .retain(|way| step < way.first_step + way.visits.len() as u32);
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::RoverId;
    use crate::mapf::safe_intervals::TimedVisit;
    use crate::testing::v;

    fn way(since: u64, first_step: u32, vertices: &[u32]) -> Way {
        let timed = |&u: &u32| TimedVisit {
            vertex: v(u),
            start: 0,
            end: 0,
        };
        Way {
            walk: Walk {
                rover: RoverId(0),
                attempt: 1,
                since,
            },
            first_step,
            visits: vertices.iter().map(timed).collect(),
        }
    }

    #[test]
    fn ways_follow_each_other_and_are_forgotten_when_done() {
        let mut ways = Ways::default();
        let (first, second) = (way(1, 1, &[4, 5, 6]), way(2, 3, &[6, 7]));
        ways.take(first.clone());
        assert!(ways.has(&first.walk) && !ways.has(&second.walk));
        ways.take(second.clone());
        // Step 3 is the second way's now: it leaves the vertex that the first one stays at.
        assert_eq!(ways.left(1), [way(1, 1, &[4, 5]), second.clone()]);
        assert_eq!(ways.left(2), [way(1, 1, &[4, 5]), second.clone()]);
        assert_eq!(ways.left(4), [second], "it stands where the way ends");
        assert!(ways.left(5).is_empty());
    }
}
