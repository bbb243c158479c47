//! The safety protocol, apart from the messages that carry it: what the owner of vertices keeps,
//! and what a rover keeps, durably. No collision rests on anything else.
//!
//! 1. A vertex's owner alone admits. A vertex is free or belongs to one (rover, step).
//! 2. It is granted only while free, and then belongs to that rover irrevocably, whether the grant
//!    arrives or not.
//! 3. A rover takes step n + 1 only after n, only by a grant for it, and only once: of two grants
//!    for one step it obeys the first. What it accepts is durable before it moves.
//! 4. A vertex held for (rover, step) is freed by proof only: the rover is on its way from there
//!    (LEAVING), it is at a later step, or it took (or is irrevocably taking) that step to
//!    somewhere else.
//!
//! By 1, 2 and 4 at most one rover may be at, or on its way to, a vertex. Swapping along an edge
//! would need each of two rovers to hold the vertex on which the other one still stands. All proofs
//! are facts that stay true ([`Whereabouts`]), so late, repeated and reordered messages do no harm.
//!
//! What happens without rule 4 is in [`farside_actors::invariants`], as a scenario of a few lines.

pub(crate) mod messages;

use farside::SimTime;
use farside_worlds::VertexId;

use crate::ids::RoverId;
use crate::safety::messages::{Grant, Holding, Whereabouts};

/// The (rover, step) to which a vertex belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Occupant {
    pub(crate) rover: RoverId,
    /// The step with which it comes, or came.
    pub(crate) step: u32,
    /// It was heard here.
    pub(crate) arrived: bool,
    /// The cycle in which the vertex was granted; once it has arrived, in which it did.
    pub(crate) since: u32,
    /// Where it came from.
    pub(crate) previous: Option<VertexId>,
    /// Its goal, once it was heard.
    pub(crate) goal: Option<VertexId>,
}

#[derive(Debug)]
struct Slot {
    vertex: VertexId,
    occupant: Option<Occupant>,
    /// How many rovers were let in from the entry queue here.
    released: u32,
}

/// News of a rover that the owner of the vertex it left may not have heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Duty {
    /// The neighbouring node to tell, until it acknowledges.
    pub(crate) to: farside_worlds::NodeId,
    pub(crate) whereabouts: Whereabouts,
}

/// What a fact changed in a [`OccupancyTable`].
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct News {
    /// Vertices that are free now.
    pub(crate) freed: Vec<VertexId>,
    /// Where rovers came from that have left again without ever being heard here: the owners of
    /// those vertices cannot know.
    pub(crate) unheard: Vec<VertexId>,
    /// The rover was heard for the first time at the vertex it was granted.
    pub(crate) arrived: bool,
}

/// An owner's durable record of its vertices.
#[derive(Debug, Default)]
pub(crate) struct OccupancyTable {
    /// In the order of the vertices.
    slots: Vec<Slot>,
    /// The latest step heard of each rover.
    known: Vec<u32>,
    duties: Vec<Duty>,
}

impl OccupancyTable {
    /// Makes a new occupancy table ready; leaves one that has survived a crash as it is.
    pub(crate) fn open(&mut self, owned: &[VertexId], rovers: usize) {
        if self.slots.is_empty() {
            let slot = |&vertex: &VertexId| Slot {
                vertex,
                occupant: None,
                released: 0,
            };
            self.slots = owned.iter().map(slot).collect();
            self.known = vec![0; rovers];
        }
    }

    /// Takes on a vertex of another node, with who holds it and how many entered there.
    pub(crate) fn adopt(&mut self, vertex: VertexId, occupant: Option<Occupant>, released: u32) {
        let slot = Slot {
            vertex,
            occupant,
            released,
        };
        match self.slots.binary_search_by_key(&vertex, |s| s.vertex) {
            Ok(at) => self.slots[at] = slot,
            Err(at) => self.slots.insert(at, slot),
        }
    }

    /// Has nothing to say of these vertices any more.
    pub(crate) fn abandon(&mut self, vertices: &[VertexId]) {
        self.slots
            .retain(|slot| vertices.binary_search(&slot.vertex).is_err());
    }

    /// A rover that has stood at `vertex` from the start, with step 1.
    pub(crate) fn stand(&mut self, vertex: VertexId, rover: RoverId, goal: VertexId) {
        self.force(vertex, rover, 1, None, 0);
        if let Some(at) = self.slot(vertex)
            && let Some(held) = &mut self.slots[at].occupant
        {
            held.arrived = true;
            held.goal = Some(goal);
        }
    }

    /// True for an occupancy table that has not been opened yet.
    pub(crate) fn is_new(&self) -> bool {
        self.slots.is_empty()
    }

    fn slot(&self, vertex: VertexId) -> Option<usize> {
        self.slots.binary_search_by_key(&vertex, |s| s.vertex).ok()
    }

    /// Who holds `vertex`; none if it is free, or not in this occupancy table.
    pub(crate) fn occupant(&self, vertex: VertexId) -> Option<&Occupant> {
        self.slots[self.slot(vertex)?].occupant.as_ref()
    }

    /// All vertices that are not free.
    pub(crate) fn occupied(&self) -> impl Iterator<Item = (VertexId, Occupant)> + '_ {
        let held = |slot: &'_ Slot| Some((slot.vertex, slot.occupant?));
        self.slots.iter().filter_map(held)
    }

    pub(crate) fn holdings(&self) -> Vec<Holding> {
        self.occupied()
            .map(|(vertex, occupant)| Holding {
                vertex,
                rover: occupant.rover,
                step: occupant.step,
                goal: occupant.goal,
            })
            .collect()
    }

    /// Gives `vertex` to (rover, step) if it is free and the request is not outdated. From then on
    /// it belongs to that rover until a fact proves otherwise.
    pub(crate) fn grant(
        &mut self,
        vertex: VertexId,
        rover: RoverId,
        step: u32,
        previous: Option<VertexId>,
        cycle: u32,
    ) -> bool {
        let Some(at) = self.slot(vertex) else {
            return false;
        };
        let outdated = self.known[rover.0 as usize] >= step;
        // A second vertex for one step would only stand empty until the rover tells.
        let twice = self
            .occupied()
            .any(|(_, held)| held.rover == rover && held.step >= step);
        if self.slots[at].occupant.is_some() || outdated || twice {
            return false;
        }
        self.force(vertex, rover, step, previous, cycle);
        true
    }

    /// Gives `vertex` away without asking whether it is free: a grant does after it has checked.
    pub(crate) fn force(
        &mut self,
        vertex: VertexId,
        rover: RoverId,
        step: u32,
        previous: Option<VertexId>,
        cycle: u32,
    ) {
        let Some(at) = self.slot(vertex) else { return };
        self.slots[at].occupant = Some(Occupant {
            rover,
            step,
            arrived: false,
            since: cycle,
            previous,
            goal: None,
        });
    }

    /// The next rover of the queue at `vertex`.
    pub(crate) fn next_in(&self, vertex: VertexId, queue: &[RoverId]) -> Option<RoverId> {
        let at = self.slot(vertex)?;
        queue.get(self.slots[at].released as usize).copied()
    }

    /// Lets in the next rover of the queue at `vertex`, if the vertex is free: exactly once for
    /// each rover, whatever crashes.
    pub(crate) fn release(
        &mut self,
        vertex: VertexId,
        queue: &[RoverId],
        cycle: u32,
    ) -> Option<RoverId> {
        let at = self.slot(vertex)?;
        let next = self.next_in(vertex, queue)?;
        if !self.grant(vertex, next, 1, None, cycle) {
            return None;
        }
        self.slots[at].released += 1;
        Some(next)
    }

    /// Takes a fact about a rover, from whomever and however late.
    pub(crate) fn hear(&mut self, fact: &Whereabouts, goal: Option<VertexId>, cycle: u32) -> News {
        let mut news = News::default();
        let Some(known) = self.known.get_mut(fact.rover.0 as usize) else {
            return news;
        };
        *known = (*known).max(fact.step);
        for slot in &mut self.slots {
            let Some(held) = &mut slot.occupant else {
                continue;
            };
            if held.rover != fact.rover {
                continue;
            }
            let here = fact.vertex == Some(slot.vertex);
            let elsewhere = fact.moving_to.is_some_and(|v| v != slot.vertex);
            let free = held.step < fact.step
                || held.step == fact.step && (!here || fact.moving_to.is_some())
                || held.step == fact.step + 1 && elsewhere;
            if free {
                let unheard = held
                    .previous
                    .filter(|_| !held.arrived && held.step < fact.step);
                news.unheard.extend(unheard);
                slot.occupant = None;
                news.freed.push(slot.vertex);
            } else if held.step == fact.step {
                held.goal = goal.or(held.goal);
                news.arrived |= !held.arrived;
                if !std::mem::replace(&mut held.arrived, true) {
                    held.since = cycle;
                }
            }
        }
        news
    }

    /// Grants made before `cycle` whose rovers were not heard to have come.
    pub(crate) fn unconfirmed(&self, cycle: u32) -> Vec<(VertexId, Occupant)> {
        let waiting = |held: &Occupant| !held.arrived && held.since < cycle;
        let all = self.occupied().filter(|(_, held)| waiting(held));
        all.collect()
    }

    /// Takes on to tell a neighbour; a newer duty to the same node about the same rover replaces
    /// the older, whose fact it implies.
    pub(crate) fn take_on(&mut self, duty: Duty) {
        let rover = duty.whereabouts.rover;
        self.duties
            .retain(|old| old.to != duty.to || old.whereabouts.rover != rover);
        self.duties.push(duty);
    }

    pub(crate) fn duties(&self) -> &[Duty] {
        &self.duties
    }

    /// Strikes a duty off that was acknowledged.
    pub(crate) fn acknowledged(&mut self, by: farside_worlds::NodeId, rover: RoverId, step: u32) {
        self.duties.retain(|duty| {
            let fact = &duty.whereabouts;
            duty.to != by || fact.rover != rover || fact.step > step
        });
    }
}

/// A rover's durable memory: where it is, and the last command it accepted.
#[derive(Clone, Debug, Default)]
pub(crate) struct RoverMemory {
    pub(crate) step: u32,
    pub(crate) vertex: Option<VertexId>,
    pub(crate) previous: Option<VertexId>,
    pub(crate) moving_to: Option<VertexId>,
    /// Grants for steps to come, of the `complete` policy.
    ahead: Vec<Grant>,
    /// When the last move began.
    pub(crate) last_move: Option<SimTime>,
}

/// What a rover does about a grant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    /// It has entered the roadmap.
    Entered,
    /// It sets out along an edge.
    SetOut,
    /// It has left the roadmap.
    Left,
    /// It has done that step, or is doing it: it tells the node where it is.
    Report,
    /// It holds: the command is not for it, here and now.
    Hold,
}

impl RoverMemory {
    /// Keeps a grant for a step to come. False if that step is done, or being done.
    pub(crate) fn keep(&mut self, grant: &Grant) -> bool {
        let next = self.step + 1 + u32::from(self.moving_to.is_some());
        if grant.step < next {
            return false;
        }
        if self.ahead.iter().all(|kept| kept.step != grant.step) {
            self.ahead.push(grant.clone());
        }
        true
    }

    /// Forgets the grants for steps to come that are void.
    pub(crate) fn forget(&mut self, is_void: impl Fn(&Grant) -> bool) {
        self.ahead.retain(|kept| !is_void(kept));
    }

    /// The grant kept for the next step, if the rover stands still.
    pub(crate) fn next_granted(&mut self) -> Option<&Grant> {
        let step = self.step;
        self.ahead.retain(|kept| kept.step > step);
        let stands = self.moving_to.is_none();
        self.ahead
            .iter()
            .find(|kept| stands && kept.step == step + 1)
    }

    /// Whether it holds the grant for `step`, and where that leads into a gap those for all further
    /// steps, up to the first that leads to a vertex that is covered.
    pub(crate) fn holds_through(&self, step: u32, covers: impl Fn(VertexId) -> bool) -> bool {
        let held = |step| self.ahead.iter().find(|kept| kept.step == step);
        let mut held = (step..).map_while(held);
        held.any(|grant| grant.to.is_none_or(&covers))
    }

    /// Where the step after the one under way leads, if it could be taken at once.
    pub(crate) fn granted_beyond(&self, covers: impl Fn(VertexId) -> bool) -> Option<VertexId> {
        let after = |kept: &&Grant| kept.step == self.step + 2;
        self.moving_to?;
        let next = self.ahead.iter().find(after)?;
        next.to.filter(|_| self.holds_through(next.step, covers))
    }

    /// Obeys a grant, if it is for the next step and leads from here: into the roadmap at `entry`,
    /// along an edge, or out of it at `goal`.
    pub(crate) fn obey(
        &mut self,
        grant: &Grant,
        entry: VertexId,
        goal: VertexId,
        adjacent: impl Fn(VertexId, VertexId) -> bool,
    ) -> Answer {
        if grant.step <= self.step || self.moving_to.is_some() {
            return Answer::Report;
        }
        if grant.step != self.step + 1 {
            return Answer::Hold;
        }
        match (self.vertex, grant.to) {
            (None, Some(to)) if self.step == 0 && to == entry => {
                self.vertex = Some(to);
                self.step = 1;
                Answer::Entered
            }
            (Some(here), Some(to)) if adjacent(here, to) => {
                self.moving_to = Some(to);
                Answer::SetOut
            }
            (Some(here), None) if here == goal => {
                self.previous = self.vertex.take();
                self.step += 1;
                Answer::Left
            }
            _ => Answer::Hold,
        }
    }

    /// Ends a move. False if there was none.
    pub(crate) fn arrive(&mut self) -> bool {
        let Some(to) = self.moving_to.take() else {
            return false;
        };
        self.previous = self.vertex.replace(to);
        self.step += 1;
        true
    }

    pub(crate) fn whereabouts(&self, rover: RoverId) -> Whereabouts {
        Whereabouts {
            rover,
            step: self.step,
            vertex: self.vertex,
            moving_to: self.moving_to,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::v;
    use farside_worlds::NodeId;

    const R: RoverId = RoverId(0);
    const Q: RoverId = RoverId(1);

    fn occupancy() -> OccupancyTable {
        let mut occupancy = OccupancyTable::default();
        occupancy.open(&[v(1), v(2), v(5)], 2);
        occupancy
    }

    fn fact(step: u32, vertex: Option<u32>, moving_to: Option<u32>) -> Whereabouts {
        Whereabouts {
            rover: R,
            step,
            vertex: vertex.map(v),
            moving_to: moving_to.map(v),
        }
    }

    #[test]
    fn a_vertex_is_granted_once_and_freed_by_proof_only() {
        let mut occupancy = occupancy();
        assert!(occupancy.grant(v(2), R, 4, Some(v(1)), 0));
        assert!(!occupancy.grant(v(2), Q, 1, None, 0), "it is taken");
        assert!(
            !occupancy.grant(v(5), R, 4, Some(v(1)), 0),
            "one vertex for a step"
        );
        // Before it came: where it was, or on its way here, proves nothing.
        for stale in [
            fact(3, Some(1), None),
            fact(3, Some(1), Some(2)),
            fact(0, None, None),
        ] {
            assert_eq!(occupancy.hear(&stale, None, 1), News::default());
        }
        let news = occupancy.hear(&fact(4, Some(2), None), Some(v(9)), 7);
        assert!(news.arrived && news.freed.is_empty());
        assert!(
            !occupancy.hear(&fact(4, Some(2), None), None, 8).arrived,
            "only once"
        );
        assert_eq!(occupancy.occupant(v(2)).unwrap().since, 7);
        let news = occupancy.hear(&fact(4, Some(2), Some(3)), None, 9);
        assert_eq!(news.freed, [v(2)], "LEAVING");
        assert!(!occupancy.grant(v(2), R, 4, None, 9), "an outdated request");
        assert!(occupancy.grant(v(2), Q, 1, None, 9));
    }

    #[test]
    fn a_grant_that_was_not_taken_is_void() {
        for proof in [
            fact(4, Some(7), None),
            fact(9, Some(7), None),
            fact(3, Some(1), Some(7)),
            fact(9, None, None),
        ] {
            let mut occupancy = occupancy();
            assert!(occupancy.grant(v(2), R, 4, Some(v(1)), 0));
            assert_eq!(occupancy.hear(&proof, None, 1).freed, [v(2)], "{proof:?}");
        }
    }

    #[test]
    fn each_queued_rover_is_let_in_once() {
        let mut occupancy = occupancy();
        assert_eq!(occupancy.release(v(5), &[Q, R], 0), Some(Q));
        assert_eq!(
            occupancy.release(v(5), &[Q, R], 1),
            None,
            "the entry is taken"
        );
        let gone = Whereabouts {
            rover: Q,
            ..fact(2, Some(6), None)
        };
        assert_eq!(occupancy.hear(&gone, None, 2).freed, [v(5)]);
        assert_eq!(occupancy.release(v(5), &[Q, R], 2), Some(R));
        occupancy.hear(&fact(1, Some(5), Some(6)), None, 3);
        assert_eq!(
            occupancy.release(v(5), &[Q, R], 3),
            None,
            "the queue is empty"
        );
    }

    #[test]
    fn duties_last_until_acknowledged() {
        let mut occupancy = occupancy();
        let duty = |step| Duty {
            to: NodeId(3),
            whereabouts: fact(step, Some(1), None),
        };
        occupancy.take_on(duty(2));
        occupancy.take_on(duty(6));
        assert_eq!(occupancy.duties(), [duty(6)]);
        occupancy.acknowledged(NodeId(3), R, 2);
        occupancy.acknowledged(NodeId(4), R, 6);
        assert_eq!(occupancy.duties(), [duty(6)]);
        occupancy.acknowledged(NodeId(3), R, 6);
        assert!(occupancy.duties().is_empty());
    }

    #[test]
    fn a_rover_obeys_only_the_next_step_from_where_it_is() {
        let adjacent = |a: VertexId, b: VertexId| a.0.abs_diff(b.0) == 1;
        let mut memory = RoverMemory::default();
        let mut obey = |step, to: Option<u32>| {
            let grant = Grant {
                node: NodeId(0),
                step,
                to: to.map(v),
            };
            let answer = memory.obey(&grant, v(1), v(3), adjacent);
            (answer, memory.clone())
        };
        assert_eq!(obey(1, Some(2)).0, Answer::Hold, "not its entry");
        assert_eq!(obey(2, Some(1)).0, Answer::Hold, "not its next step");
        assert_eq!(obey(1, Some(1)).0, Answer::Entered);
        assert_eq!(obey(1, Some(1)).0, Answer::Report, "done");
        assert_eq!(obey(2, Some(3)).0, Answer::Hold, "not adjacent");
        assert_eq!(obey(2, None).0, Answer::Hold, "not at its goal");
        let (answer, after) = obey(2, Some(2));
        assert_eq!((answer, after.moving_to), (Answer::SetOut, Some(v(2))));
        assert_eq!(
            obey(2, Some(0)).0,
            Answer::Report,
            "it is on its way elsewhere"
        );
        assert!(memory.arrive() && !memory.arrive());
        assert_eq!((memory.step, memory.previous), (2, Some(v(1))));
    }
}
