//! Who claims which vertex and which edge, and who claims the same.

use std::collections::BTreeMap;
use std::fmt;

use farside::SimTime;
use serde::{Serialize, Serializer};

/// How many collisions are kept by name; all are counted.
pub const NAMED_COLLISIONS: usize = 16;

/// Where an agent is on a graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Place<V> {
    /// Nowhere on it: in a queue, at home, gone. It claims nothing.
    #[default]
    Away,
    /// It stands at a vertex, and claims it.
    At(V),
    /// It is on the edge from the first to the second vertex. It claims the edge and the second
    /// vertex, and no longer the one it leaves: a vertex is one agent wide, an edge much longer.
    Between(V, V),
}

impl<V: Copy> Place<V> {
    /// The vertex that an agent here claims.
    pub fn claim(&self) -> Option<V> {
        match *self {
            Place::Away => None,
            Place::At(v) | Place::Between(_, v) => Some(v),
        }
    }

    /// Where an agent here was last: its vertex, or the one it is leaving.
    pub fn vertex(&self) -> Option<V> {
        match *self {
            Place::Away => None,
            Place::At(v) | Place::Between(v, _) => Some(v),
        }
    }

    fn edge(&self) -> Option<(V, V)> {
        match *self {
            Place::Between(from, to) => Some((from, to)),
            _ => None,
        }
    }
}

/// What two agents claimed at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Contested<V> {
    /// The same vertex.
    Vertex(V),
    /// The same edge in opposite directions; this is the direction of the one that came.
    Edge(V, V),
}

/// A collision: two agents with a claim on one vertex, or on one edge in opposite directions.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Collision<V> {
    /// When the second claim was made; in seconds where it is written.
    #[serde(rename = "at_s", serialize_with = "seconds")]
    pub at: SimTime,
    /// Who made it.
    pub agent: String,
    /// Who had a claim before.
    pub other: String,
    /// On what.
    pub on: Contested<V>,
}

fn seconds<S: Serializer>(at: &SimTime, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(at.as_secs_f64())
}

impl<V: fmt::Display> fmt::Display for Collision<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Collision {
            at,
            agent,
            other,
            on,
        } = self;
        match on {
            Contested::Vertex(v) => write!(f, "{agent} met {other} at vertex {v} at {at}"),
            Contested::Edge(u, v) => {
                write!(f, "{agent} met {other} on the edge from {u} to {v} at {at}")
            }
        }
    }
}

/// Keeps agents' claims on the vertices and edges of a graph, and finds collisions as they arise.
/// It knows nothing of the graph but what agents claim, and nothing of why they do.
///
/// A collision is counted when its second claim is made, once for each pair; two that stay where
/// they met do not collide again. Each change costs a few map look-ups, whatever the number of
/// agents.
///
/// ```
/// use farside::SimTime;
/// use farside_actors::invariants::{Collisions, Place};
/// let mut collisions = Collisions::new();
/// let (a, b) = (collisions.add("cart_a"), collisions.add("cart_b"));
/// let at = SimTime::from_nanos;
/// collisions.update(at(1), a, Place::At(1));
/// collisions.update(at(2), b, Place::At(2));
/// // The vertex is left as soon as the cart sets out: another may follow.
/// assert_eq!(collisions.update(at(3), b, Place::Between(2, 3)), 0);
/// assert_eq!(collisions.update(at(4), a, Place::Between(1, 2)), 0);
/// // But not come back on the same edge.
/// collisions.update(at(5), b, Place::At(3));
/// collisions.update(at(6), a, Place::At(2));
/// assert_eq!(collisions.update(at(7), a, Place::Between(2, 3)), 1);
/// assert_eq!(collisions.named()[0].to_string(), "cart_a met cart_b at vertex 3 at 7ns");
/// ```
#[derive(Clone, Debug)]
pub struct Collisions<V> {
    names: Vec<String>,
    places: Vec<Place<V>>,
    /// Who claims each vertex, ascending.
    vertices: BTreeMap<V, Vec<usize>>,
    /// Who is on each edge, by its direction.
    edges: BTreeMap<(V, V), Vec<usize>>,
    count: u64,
    named: Vec<Collision<V>>,
}

impl<V> Default for Collisions<V> {
    fn default() -> Self {
        Collisions {
            names: Vec::new(),
            places: Vec::new(),
            vertices: BTreeMap::new(),
            edges: BTreeMap::new(),
            count: 0,
            named: Vec::new(),
        }
    }
}

impl<V: Copy + Ord> Collisions<V> {
    /// Nobody yet.
    pub fn new() -> Self {
        Collisions::default()
    }

    /// Takes an agent up, which is away, and returns its number: from 0, in this order.
    pub fn add(&mut self, name: &str) -> usize {
        self.names.push(name.to_owned());
        self.places.push(Place::Away);
        self.places.len() - 1
    }

    /// The agent is at `place` from `now` on. Returns how many collisions that makes.
    ///
    /// # Panics
    /// When there is no such agent: a bug in the caller, here and below.
    pub fn update(&mut self, now: SimTime, agent: usize, place: Place<V>) -> u32 {
        let old = std::mem::replace(&mut self.places[agent], place);
        if old == place {
            return 0;
        }
        if let Some(v) = old.claim() {
            withdraw(&mut self.vertices, v, agent);
        }
        if let Some(edge) = old.edge() {
            withdraw(&mut self.edges, edge, agent);
        }
        let mut met = Vec::new();
        if let Some(v) = place.claim().filter(|_| place.claim() != old.claim()) {
            let there = self.vertices.get(&v).into_iter().flatten();
            met.extend(there.map(|&other| (other, Contested::Vertex(v))));
        }
        if let Some((u, v)) = place.edge() {
            let against = self.edges.get(&(v, u)).into_iter().flatten();
            met.extend(against.map(|&other| (other, Contested::Edge(u, v))));
        }
        if let Some(v) = place.claim() {
            claim(&mut self.vertices, v, agent);
        }
        if let Some(edge) = place.edge() {
            claim(&mut self.edges, edge, agent);
        }
        for &(other, on) in &met {
            self.count += 1;
            if self.named.len() < NAMED_COLLISIONS {
                self.named.push(Collision {
                    at: now,
                    agent: self.names[agent].clone(),
                    other: self.names[other].clone(),
                    on,
                });
            }
        }
        met.len() as u32
    }

    /// How many collisions there were.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The first of them, [`NAMED_COLLISIONS`] at most.
    pub fn named(&self) -> &[Collision<V>] {
        &self.named
    }

    /// Where the agent is.
    pub fn place(&self, agent: usize) -> Place<V> {
        self.places[agent]
    }

    /// The agent's name.
    pub fn name(&self, agent: usize) -> &str {
        &self.names[agent]
    }

    /// Who claims the vertex, ascending.
    pub fn holders(&self, vertex: V) -> &[usize] {
        self.vertices.get(&vertex).map_or(&[], Vec::as_slice)
    }
}

fn claim<K: Ord>(claims: &mut BTreeMap<K, Vec<usize>>, what: K, agent: usize) {
    let holders = claims.entry(what).or_default();
    let at = holders.partition_point(|&other| other < agent);
    holders.insert(at, agent);
}

fn withdraw<K: Ord>(claims: &mut BTreeMap<K, Vec<usize>>, what: K, agent: usize) {
    if let Some(holders) = claims.get_mut(&what) {
        holders.retain(|&other| other != agent);
        if holders.is_empty() {
            claims.remove(&what);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(second: u64) -> SimTime {
        SimTime::from_nanos(second * 1_000_000_000)
    }

    #[test]
    fn those_who_swap_places_collide_on_the_edge() {
        let mut collisions = Collisions::new();
        let (a, b) = (collisions.add("a"), collisions.add("b"));
        collisions.update(at(0), a, Place::At(1));
        collisions.update(at(0), b, Place::At(2));
        // The second vertex is still b's.
        assert_eq!(collisions.update(at(1), a, Place::Between(1, 2)), 1);
        assert_eq!(collisions.update(at(1), b, Place::Between(2, 1)), 1);
        let texts: Vec<String> = collisions.named().iter().map(ToString::to_string).collect();
        let edge = "b met a on the edge from 2 to 1 at 1s";
        assert_eq!(texts, ["a met b at vertex 2 at 1s", edge]);
        assert_eq!(collisions.update(at(2), a, Place::At(2)), 0, "not again");
        assert_eq!(collisions.count(), 2);
    }

    #[test]
    fn only_the_first_are_kept_by_name_and_all_are_counted() {
        let mut collisions = Collisions::new();
        let (a, b) = (collisions.add("a"), collisions.add("b"));
        collisions.update(at(0), a, Place::At(1));
        for second in 1..=40 {
            collisions.update(at(second), b, Place::At(1));
            collisions.update(at(second), b, Place::Away);
        }
        assert_eq!(
            (collisions.count(), collisions.named().len()),
            (40, NAMED_COLLISIONS)
        );
    }

    fn place() -> impl Strategy<Value = Place<u8>> {
        prop_oneof![
            Just(Place::Away),
            (0..4u8).prop_map(Place::At),
            (0..4u8, 1..4u8).prop_map(|(u, by)| Place::Between(u, (u + by) % 4)),
        ]
    }

    proptest! {
        /// Against the definition, word for word: each change is held against every other agent.
        #[test]
        fn collisions_are_those_of_the_definition(
            changes in prop::collection::vec((0..5usize, place()), 0..60),
        ) {
            let mut collisions = Collisions::new();
            let names = ["a", "b", "c", "d", "e"];
            let mut places = names.map(|name| { collisions.add(name); Place::Away });
            for (second, (agent, place)) in (0..).zip(changes) {
                let old = std::mem::replace(&mut places[agent], place);
                let meets = |other: &Place<u8>| {
                    let vertex = place.claim().is_some() && place.claim() == other.claim();
                    let edge = matches!((place, *other),
                        (Place::Between(a, b), Place::Between(c, d)) if (a, b) == (d, c));
                    let claims_anew = old.claim() != place.claim();
                    u32::from(vertex && claims_anew) + u32::from(edge && old != place)
                };
                let others = places.iter().enumerate().filter(|&(other, _)| other != agent);
                let expected: u32 = others.map(|(_, other)| meets(other)).sum();
                prop_assert_eq!(collisions.update(at(second), agent, place), expected);
            }
        }
    }
}
