//! Failover: who answers for the vertices of a node that has fallen silent, and what makes that
//! safe (*network-guided*, section 5, asks "how should the network adapt when a node fails").
//!
//! **Backup lists.** The vertices of each node are a *region*, which is called by that node. Each
//! region has a backup list that follows from the map alone ([`backup_lists`]): its own node at
//! rank 0, then backups that are radio neighbours of it and of each other. The node at rank k may
//! take the region over when all of lower rank that could still answer for it are silent.
//!
//! **Fencing.** A backup of rank k asks every rover, again and again until each has answered. A
//! rover that is asked durably raises its fencing token for this region to k, and answers where it
//! is. From then on it obeys grants of this region's vertices from the backup of rank k only
//! ([`FencingTokens`]). The tokens, often called epochs, only rise.
//!
//! **Why no two rovers meet.** Let v be a vertex of the region, and let the backup of rank k open
//! it when all rovers have answered at rank k. A grant of v by a lower rank was obeyed before the
//! rover answered, or never will be. If it was obeyed before, then at its answer the rover was at
//! v, or on its way there, or had left v for good: its account says which, because what a rover
//! obeys is durable before it moves. So the rovers that are, or may ever again come, to v by grants
//! of lower ranks are those that the accounts name, and v is opened as theirs; there is at most
//! one, because up to then one occupancy table at a time admitted to v. A grant that was sent and
//! not obeyed is void. A backup of higher rank opens only when all tokens are above k, and the same
//! holds for it. Suspicion plays no part in this: a node that lives and is only unheard is fenced
//! like one that is dead, and two backups that ask at the same time cannot both be answered by all
//! at their rank and still be obeyed.
//!
//! A second failure is the same case. When the backup falls silent, the next in the list goes on
//! for the same region, with rovers' accounts anew; and the backup's own vertices have a list of
//! their own. Nodes say for whom they answer, so that a region is not left that was given up to a
//! backup that then failed. When a list is at its end, or a rover never answers, nothing happens
//! and the vertices stay closed. A node that was replaced stays out for the rest of the run.
//!
//! **Reserved paths**, of the policy `complete`, are told with the accounts; what else becomes of
//! them is in `reservation::registry::failover`. A backup and the neighbours of its regions need
//! not hear each other: what they say is passed on by others, one hop after the other, each of
//! which may lose it. Over links that lose much that takes its time: with a fifth lost and four
//! hops between them, minutes.

pub(crate) mod messages;
pub(crate) mod rank;

use farside_worlds::{NodeId, Roadmap, SensorNetwork, VertexId};

use crate::failover::messages::Account;
use crate::ids::RoverId;
use crate::safety::Occupant;
use crate::safety::messages::Whereabouts;

/// Each node's backup list, itself first. The next in it is, of the radio neighbours of all
/// before it, the one that is itself, or has as radio neighbours, most of the owners of vertices
/// next to the node's; of several the lowest.
pub(crate) fn backup_lists(roadmap: &Roadmap, sensors: &SensorNetwork) -> Vec<Vec<NodeId>> {
    let line = |region: NodeId| {
        let mut beside: Vec<NodeId> = sensors
            .owned(region)
            .iter()
            .flat_map(|&v| roadmap.neighbors(v))
            .map(|&v| sensors.owner(v))
            .filter(|&owner| owner != region)
            .collect();
        beside.sort_unstable();
        beside.dedup();
        let reach = |m: NodeId| {
            let hears = |&&o: &&NodeId| o == m || sensors.are_neighbors(o, m);
            beside.iter().filter(hears).count()
        };
        let mut line = vec![region];
        let mut left = sensors.neighbors(region).to_vec();
        while let Some(&next) = left.iter().max_by_key(|&&m| (reach(m), u32::MAX - m.0)) {
            line.push(next);
            left.retain(|&m| sensors.are_neighbors(m, next));
        }
        line
    };
    sensors.nodes().map(line).collect()
}

/// A rover's durable memory of who may still grant it which vertices: a rank for each region that
/// was ever asked about. Without an entry it is 0, the region's own node.
#[derive(Debug, Default)]
pub(crate) struct FencingTokens {
    ranks: Vec<(NodeId, u32)>,
}

impl FencingTokens {
    pub(crate) fn rank(&self, region: NodeId) -> u32 {
        let known = self.ranks.iter().find(|(node, _)| *node == region);
        known.map_or(0, |&(_, rank)| rank)
    }

    /// Raises the token to `rank`, if it is lower.
    pub(crate) fn raise(&mut self, region: NodeId, rank: u32) {
        match self.ranks.iter_mut().find(|(node, _)| *node == region) {
            Some((_, known)) => *known = (*known).max(rank),
            None => self.ranks.push((region, rank)),
        }
    }
}

/// A failover that a backup has begun: it asks rovers about one region.
#[derive(Debug)]
pub(crate) struct PendingFailover {
    pub(crate) region: NodeId,
    pub(crate) rank: u32,
    /// What each rover of the whole team has answered.
    pub(crate) accounts: Vec<Option<Account>>,
    /// The rovers that take part, which all have to.
    pub(crate) asked: Vec<RoverId>,
}

impl PendingFailover {
    /// Rovers that have not answered.
    pub(crate) fn missing(&self) -> impl Iterator<Item = RoverId> + '_ {
        let has_none = |rover: &RoverId| self.accounts[rover.0 as usize].is_none();
        self.asked.iter().copied().filter(has_none)
    }
}

/// A node's durable memory of failovers.
#[derive(Debug, Default)]
pub(crate) struct FailoverRecord {
    /// The regions that this node answers for, ascending; at first its own.
    pub(crate) regions: Vec<NodeId>,
    /// The rank that answers for each region, as far as is known here.
    pub(crate) ranks: Vec<u32>,
    pub(crate) pending: Vec<PendingFailover>,
    /// The latest fact heard of each rover.
    facts: Vec<Option<Whereabouts>>,
}

impl FailoverRecord {
    /// Makes a new record ready; leaves one that has survived a crash as it is.
    pub(crate) fn open(&mut self, id: NodeId, nodes: usize, rovers: usize) {
        if self.ranks.is_empty() {
            self.regions = vec![id];
            self.ranks = vec![0; nodes];
            self.facts = vec![None; rovers];
        }
    }

    /// Remembers a fact if it is later than what is known.
    pub(crate) fn note(&mut self, fact: &Whereabouts) {
        if let Some(known) = self.facts.get_mut(fact.rover.0 as usize)
            && known.is_none_or(|old| age(&old) < age(fact))
        {
            *known = Some(*fact);
        }
    }

    /// The latest fact heard of a rover.
    pub(crate) fn fact(&self, rover: RoverId) -> Option<Whereabouts> {
        *self.facts.get(rover.0 as usize)?
    }

    /// Gives a region up, and whatever was asked about it at `rank` or below. False if this node
    /// did not answer for it.
    pub(crate) fn resign(&mut self, region: NodeId, rank: u32) -> bool {
        self.pending
            .retain(|pending| pending.region != region || pending.rank > rank);
        let before = self.regions.len();
        self.regions.retain(|&h| h != region);
        self.regions.len() < before
    }

    /// Keeps an answer to a pending failover. True if it was the last that was missing.
    pub(crate) fn answered(&mut self, account: Account) -> bool {
        let asked = |i: &&mut PendingFailover| i.region == account.region && i.rank == account.rank;
        let Some(pending) = self.pending.iter_mut().find(asked) else {
            return false;
        };
        if let Some(slot) = pending
            .accounts
            .get_mut(account.whereabouts.rover.0 as usize)
        {
            *slot = Some(account);
        }
        pending.missing().next().is_none()
    }

    /// Ends a pending failover that all have answered, and takes the region on. Each rover's latest
    /// account, with later facts in their place.
    pub(crate) fn take_on(&mut self, region: NodeId, rank: u32) -> Vec<Account> {
        let asked = |i: &PendingFailover| i.region == region && i.rank == rank;
        let Some(at) = self.pending.iter().position(asked) else {
            return Vec::new();
        };
        let pending = self.pending.remove(at);
        self.ranks[region.0 as usize] = rank;
        self.regions.push(region);
        self.regions.sort_unstable();
        self.regions.dedup();
        let latest = |account: Account| {
            let known = self.fact(account.whereabouts.rover);
            match known.filter(|fact| age(fact) > age(&account.whereabouts)) {
                Some(whereabouts) => Account {
                    previous: None,
                    whereabouts,
                    ..account
                },
                None => account,
            }
        };
        pending.accounts.into_iter().flatten().map(latest).collect()
    }
}

/// Of two facts about a rover the one with the greater age was true later.
fn age(fact: &Whereabouts) -> (u32, bool) {
    (fact.step, fact.moving_to.is_some())
}

/// Who holds `vertex` by rovers' accounts: the one that is there and not leaving, or on its way
/// there.
pub(crate) fn holder(accounts: &[Account], vertex: VertexId, cycle: u32) -> Option<Occupant> {
    let claims = |account: &&Account| {
        let fact = &account.whereabouts;
        fact.moving_to.or(fact.vertex) == Some(vertex)
    };
    let account = accounts.iter().find(claims)?;
    let fact = &account.whereabouts;
    let comes = fact.moving_to.is_some();
    Some(Occupant {
        rover: fact.rover,
        step: fact.step + u32::from(comes),
        arrived: !comes,
        since: cycle,
        previous: if comes { fact.vertex } else { account.previous },
        goal: Some(account.goal),
    })
}

/// How many of a queue have entered, by their accounts. A vertex is granted to the next in the
/// queue only when the one before has gone on, so they are the first.
pub(crate) fn released(accounts: &[Account], queue: &[RoverId]) -> u32 {
    let entered = |rover: &&RoverId| {
        accounts
            .iter()
            .any(|a| a.whereabouts.rover == **rover && a.whereabouts.step > 0)
    };
    queue.iter().take_while(entered).count() as u32
}

#[cfg(test)]
mod tests;
