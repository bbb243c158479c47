//! What a rover keeps of the paths that it has taken, with `network.failover_after`: whoever takes
//! over for a node asks for them.

use super::messages::{ReservationRequest, TimedPath};

/// A rover's durable memory of its paths, in order; each begins where the one before ends.
#[derive(Debug, Default)]
pub(crate) struct TimedPaths(Vec<TimedPath>);

impl TimedPaths {
    pub(crate) fn has(&self, request: &ReservationRequest) -> bool {
        self.0.iter().any(|path| path.request == *request)
    }

    /// Takes a path, which goes on from the step with which it begins.
    pub(crate) fn take(&mut self, path: TimedPath) {
        for before in &mut self.0 {
            let keeps = path.first_step.saturating_sub(before.first_step);
            before.visits.truncate(keeps as usize);
        }
        self.0.push(path);
        self.0.retain(|path| !path.visits.is_empty());
    }

    /// The paths that a rover that has done `step` has not driven to their ends. Those it has are
    /// forgotten.
    pub(crate) fn left(&mut self, step: u32) -> &[TimedPath] {
        self.0
            .retain(|path| step < path.first_step + path.visits.len() as u32);
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::RoverId;
    use crate::mapf::safe_intervals::TimedVisit;
    use crate::testing::v;

    fn path(since: u64, first_step: u32, vertices: &[u32]) -> TimedPath {
        let timed = |&u: &u32| TimedVisit {
            vertex: v(u),
            start: 0,
            end: 0,
        };
        TimedPath {
            request: ReservationRequest {
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
        let mut paths = TimedPaths::default();
        let (first, second) = (path(1, 1, &[4, 5, 6]), path(2, 3, &[6, 7]));
        paths.take(first.clone());
        assert!(paths.has(&first.request) && !paths.has(&second.request));
        paths.take(second.clone());
        // Step 3 is the second path's now: it leaves the vertex that the first one stays at.
        assert_eq!(paths.left(1), [path(1, 1, &[4, 5]), second.clone()]);
        assert_eq!(paths.left(2), [path(1, 1, &[4, 5]), second.clone()]);
        assert_eq!(paths.left(4), [second], "it stands where the path ends");
        assert!(paths.left(5).is_empty());
    }
}
