//! In which order rovers are planned, where one is planned after the other. Whatever the order,
//! nobody is planned before those that stand before it in its queue.

use farside::random::RandomKey;

use super::problem::{Problem, Rules};
use super::timetable::{Pace, Timetable};

/// Who is planned before whom.
///
/// ```
/// use farside_network::mapf::{Mission, Order, Problem, Rules};
/// use farside_worlds::{Roadmap, VertexId as V};
/// let text = "name = 'line'\nboundary = [0, 2]\npositions_m = [[0, 0], [5, 0], [9, 0]]\n\
///             edges = [[0, 1], [1, 2]]";
/// let map = Roadmap::from_toml(text)?;
/// let missions = [(0, 2), (0, 2), (2, 1)].map(|(a, b)| Mission::new(V(a), V(b)));
/// let problem = Problem::new(&map, missions.to_vec(), Rules::DisappearAtTarget)?;
/// assert_eq!(Order::QueuePosition.orders(&problem).collect::<Vec<_>>(), [[0, 2, 1]]);
/// assert_eq!(Order::ShortestFirst.orders(&problem).collect::<Vec<_>>(), [[2, 0, 1]]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The heads of all queues, then those behind them, and so on; equals by number. With
    /// [`Rules::StayAtTarget`] simply by number.
    QueuePosition,
    /// Of those at the heads of what is left of the queues, the one with the shortest way to
    /// drive, equals by number.
    ShortestFirst,
    /// The best of so many orders drawn at random (Bennewitz, Burgard and Thrun 2002): the fewest
    /// failures, then the smallest sum of costs, then the first. Raising `tries` keeps the orders
    /// there were.
    Random {
        /// How many; 0 counts as 1.
        tries: u32,
        /// What draws them.
        seed: u64,
    },
}

impl Order {
    /// The orders that it stands for, each with every rover once.
    pub fn orders(self, problem: &Problem<'_>) -> impl Iterator<Item = Vec<usize>> {
        let tries = match self {
            Order::Random { tries, .. } => tries.max(1),
            _ => 1,
        };
        (0..tries).map(move |attempt| match self {
            Order::QueuePosition => queue_position(problem),
            Order::ShortestFirst => shortest_first(problem),
            Order::Random { seed, .. } => random(problem, seed, attempt),
        })
    }

    /// The best outcome of a planner over these orders.
    pub(crate) fn best(
        self,
        problem: &Problem<'_>,
        pace: &Pace<'_>,
        enough: impl Fn(&Timetable) -> bool,
        mut plan: impl FnMut(&[usize]) -> Timetable,
    ) -> Timetable {
        let mut best: Option<Timetable> = None;
        let mut tries = 0;
        for order in self.orders(problem) {
            let outcome = plan(&order);
            tries += 1;
            if best
                .as_ref()
                .is_none_or(|best| outcome.is_better_than(best, pace))
            {
                best = Some(outcome);
            }
            if best.as_ref().is_some_and(&enough) {
                break;
            }
        }
        let mut best = best.expect("there is at least one order");
        best.tries = tries;
        best
    }
}

fn queue_position(problem: &Problem<'_>) -> Vec<usize> {
    if problem.rules() == Rules::StayAtTarget {
        return (0..problem.missions().len()).collect();
    }
    let mut order: Vec<(usize, usize)> = Vec::new();
    for queue in problem.queues() {
        order.extend(queue.iter().copied().enumerate());
    }
    order.sort_unstable();
    order.into_iter().map(|(_, rover)| rover).collect()
}

fn shortest_first(problem: &Problem<'_>) -> Vec<usize> {
    let mut heads: Vec<&[usize]> = problem.queues().iter().map(Vec::as_slice).collect();
    let mut order = Vec::with_capacity(problem.missions().len());
    loop {
        heads.retain(|queue| !queue.is_empty());
        let key = |queue: &&mut &[usize]| (problem.shortest(queue[0]), queue[0]);
        let Some(queue) = heads.iter_mut().min_by_key(key) else {
            return order;
        };
        order.push(queue[0]);
        *queue = &queue[1..];
    }
}

/// Shuffles whose turn it is, queue by queue, which makes each order that keeps the queues as
/// likely as any other.
fn random(problem: &Problem<'_>, seed: u64, attempt: u32) -> Vec<usize> {
    let key = RandomKey::new(seed).text("planning order");
    let mut draws = key.number(u64::from(attempt)).stream();
    let queues = problem.queues();
    let mut turns: Vec<usize> = Vec::with_capacity(problem.missions().len());
    for (queue, rovers) in queues.iter().enumerate() {
        turns.extend(rovers.iter().map(|_| queue));
    }
    draws.shuffle(&mut turns);
    let mut next = vec![0; queues.len()];
    let mut take = |queue: usize| {
        next[queue] += 1;
        queues[queue][next[queue] - 1]
    };
    turns.into_iter().map(&mut take).collect()
}
