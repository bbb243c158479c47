//! From assigned paths to requests for vertices, and who wins one (*network-guided*, section 3.5).
//!
//! No candidate path enters an occupied vertex in the cycle to come, so two paths can only collide
//! in it by entering the same free vertex: its owner picks one, and the others stand still, which
//! harms nobody.

use farside_worlds::VertexId;

use crate::ids::RoverId;
use crate::max_plus::candidates::FirstStep;
use crate::max_plus::config::Priority;
use crate::max_plus::messages::Assignment;

/// What an assigned path asks of the owner of the vertex that it enters next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) vertex: VertexId,
    pub(crate) rover: RoverId,
    pub(crate) step: u32,
    /// Where the rover is.
    pub(crate) from: VertexId,
    /// For how many cycles it has stood there.
    pub(crate) waited: u32,
    /// The path begins with a wait because the vertex is occupied: it may accelerate.
    pub(crate) follows: bool,
}

impl Request {
    /// None if the path stays.
    pub(crate) fn of(assignment: &Assignment) -> Option<Request> {
        let (vertex, follows) = match assignment.path.first_step() {
            FirstStep::Stay => return None,
            FirstStep::Move(vertex) => (vertex, false),
            FirstStep::Follow(vertex) => (vertex, true),
        };
        Some(Request {
            vertex,
            rover: assignment.rover,
            step: assignment.step,
            from: assignment.path.vertices[0],
            waited: assignment.waited,
            follows,
        })
    }
}

/// The request to grant: one that does not follow before one that does, then by priority.
pub(crate) fn winner<'a>(
    requests: impl Iterator<Item = &'a Request>,
    priority: Priority,
) -> Option<&'a Request> {
    requests.min_by_key(|request| {
        let patience = match priority {
            Priority::LongestWait => u32::MAX - request.waited,
            Priority::LowestId => 0,
        };
        (request.follows, patience, request.rover)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::v;

    fn request(rover: u32, waited: u32, follows: bool) -> Request {
        Request {
            vertex: v(3),
            rover: RoverId(rover),
            step: 1,
            from: v(2),
            waited,
            follows,
        }
    }

    #[test]
    fn the_longest_wait_wins_and_the_lowest_number_of_equals() {
        let all = [
            request(4, 2, false),
            request(2, 5, false),
            request(1, 5, false),
            request(0, 9, true),
        ];
        let first = |priority| winner(all.iter(), priority).unwrap().rover.0;
        assert_eq!(first(Priority::LongestWait), 1);
        assert_eq!(first(Priority::LowestId), 1);
        assert_eq!(
            winner(all[..2].iter(), Priority::LowestId).unwrap().rover.0,
            2
        );
        assert!(winner([].iter(), Priority::LowestId).is_none());
    }
}
