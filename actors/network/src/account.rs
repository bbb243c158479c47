//! What a rover or a node did in a run and what it waited for, from the states that rovers recorded.

use std::collections::BTreeSet;

use farside_actors::invariants::Place;
use farside_actors::system::{Account, Doing, Phase, PictureError, Recording, Setup};
use farside_worlds::{NodeId, VertexId};

use crate::ids;
use crate::picture::{self, Drawn};
use crate::scenario::NetworkScenario;
use crate::tracks::{Mark, Sighting};
use crate::waits::{Waits, nearer};

/// As many steps of who waits for whom as are told.
const STEPS: usize = 6;

/// The account of an actor up to a time; none if it is neither a rover nor a node.
pub(crate) fn account(
    scenario: &NetworkScenario,
    actor: &str,
    run: &dyn Recording,
    until_ns: Option<u64>,
    setup: &mut Setup<'_>,
) -> Result<Option<Account>, PictureError> {
    let drawn = picture::drawn(scenario, run, setup)?;
    let end_ns = drawn.tracks.end_ns;
    let until_ns = until_ns.map_or(end_ns, |until| until.min(end_ns));
    let team = Team { drawn, until_ns };
    let rover = (0..team.drawn.site.rovers).find(|rover| team.rover(*rover) == actor);
    if let Some(rover) = rover {
        return Ok(Some(team.of_rover(rover)));
    }
    let node = team
        .drawn
        .site
        .sensors
        .nodes()
        .find(|node| team.node(*node) == actor);
    Ok(node.map(|node| team.of_node(node)))
}

/// A run, as far as it is told.
struct Team {
    drawn: Drawn,
    until_ns: u64,
}

/// What a rover waits for at an instant.
struct Wait {
    text: String,
    waits_for: Vec<String>,
}

impl Team {
    fn rover(&self, rover: u32) -> String {
        ids::name("rover", rover, self.drawn.site.rovers)
    }

    fn node(&self, node: NodeId) -> String {
        let count = self.drawn.site.sensors.len() as u32;
        ids::name("node", node.0, count)
    }

    /// Since when an actor has been down.
    fn down_since(&self, actor: &str, time_ns: u64) -> Option<u64> {
        let outages = self.drawn.tracks.outages.iter();
        let is_down = |from_ns: u64, to_ns: Option<u64>| {
            from_ns <= time_ns && to_ns.is_none_or(|to_ns| time_ns < to_ns)
        };
        outages
            .filter(|outage| outage.actor == actor && is_down(outage.from_ns, outage.to_ns))
            .map(|outage| outage.from_ns)
            .next_back()
    }

    /// When something begins or ends that rovers may wait for, within a time, its beginning included.
    fn instants(&self, from_ns: u64, until_ns: u64) -> BTreeSet<u64> {
        let tracks = &self.drawn.tracks;
        let moves = tracks
            .rovers()
            .flat_map(|(_, marks)| marks.iter().map(|mark| mark.time_ns));
        let outages = tracks.outages.iter();
        let outages = outages.flat_map(|outage| [Some(outage.from_ns), outage.to_ns]);
        let mut instants: BTreeSet<u64> = moves
            .chain(outages.flatten())
            .filter(|time_ns| (from_ns..until_ns).contains(time_ns))
            .collect();
        instants.insert(from_ns);
        instants
    }

    fn of_rover(&self, rover: u32) -> Account {
        let mut account = Account::default();
        let marks = self
            .drawn
            .tracks
            .rovers()
            .find(|(number, _)| *number == rover);
        let marks = marks.map_or(&[][..], |(_, marks)| marks);
        let mut driving: Option<(u64, VertexId, u32)> = None;
        for (at, mark) in marks.iter().enumerate() {
            let next_ns = marks.get(at + 1).map_or(self.until_ns, |next| next.time_ns);
            let (from_ns, until_ns) = (mark.time_ns, next_ns.min(self.until_ns));
            if from_ns > self.until_ns {
                break;
            }
            match mark.place {
                Place::Between(from, to) => {
                    let (since_ns, start, edges) = driving.unwrap_or((from_ns, from, 0));
                    driving = Some((since_ns, start, edges + 1));
                    let edges = match edges + 1 {
                        1 => String::new(),
                        edges => format!(", {edges} edges"),
                    };
                    let text = format!("drives from {start} to {to}{edges}");
                    // One drive over several edges is one phase.
                    let drives = account.phases.last_mut();
                    match drives.filter(|last| last.from_ns == since_ns) {
                        Some(last) => (last.until_ns, last.text) = (until_ns, text),
                        None => account.push(active(from_ns, until_ns, text)),
                    }
                }
                _ if mark.place.claim() == Some(mark.goal) => {
                    driving = None;
                    account.push(Phase {
                        from_ns,
                        until_ns,
                        doing: Doing::Done,
                        text: format!("is at its goal {}", mark.goal),
                        waits_for: Vec::new(),
                    });
                }
                Place::Away if mark.step > 0 => {
                    driving = None;
                    account.push(Phase {
                        from_ns,
                        until_ns,
                        doing: Doing::Done,
                        text: format!("has left the map at its goal {}", mark.goal),
                        waits_for: Vec::new(),
                    });
                }
                Place::Away | Place::At(_) => {
                    if until_ns > from_ns {
                        driving = None;
                    }
                    self.stand(rover, mark, until_ns, &mut account);
                }
            }
        }
        self.with_outages(&self.rover(rover), account)
    }

    /// A rover stands, or queues.
    fn stand(&self, rover: u32, mark: &Mark, until_ns: u64, account: &mut Account) {
        let instants: Vec<u64> = self.instants(mark.time_ns, until_ns).into_iter().collect();
        for (at, from_ns) in instants.iter().enumerate() {
            let until_ns = instants.get(at + 1).map_or(until_ns, |next| *next);
            let sightings = self.drawn.tracks.at(*from_ns);
            let waits = self.drawn.waits(&sightings);
            let Wait { text, waits_for } = self.wait(rover, *from_ns, &sightings, &waits);
            account.push(Phase {
                from_ns: *from_ns,
                until_ns,
                doing: Doing::Waiting,
                text,
                waits_for,
            });
        }
    }

    /// What a rover waits for, and what that waits for, until there is no more to tell.
    fn wait(&self, rover: u32, time_ns: u64, sightings: &[Sighting], waits: &Waits) -> Wait {
        let sighted = |rover: u32| sightings.iter().find(|sighting| sighting.rover == rover);
        let mut text = match sighted(rover) {
            Some(Sighting {
                place: Place::At(here),
                ..
            }) => format!("stands at {here}"),
            Some(sighting) => format!("queues at entry {}", sighting.entry),
            None => {
                return Wait {
                    text: "is not there".to_owned(),
                    waits_for: Vec::new(),
                };
            }
        };
        let mut waits_for = Vec::new();
        let (mut current, mut seen) = (rover, vec![rover]);
        for step in 0..STEPS {
            let link = if step == 0 {
                ", waits for "
            } else {
                ", which waits for "
            };
            let on = waits.on.get(&current);
            if let Some(on) = on {
                let holder = on.iter().find(|next| !seen.contains(next)).or(on.first());
                let Some(&next) = holder else { break };
                let names: Vec<String> = on.iter().map(|rover| self.rover(*rover)).collect();
                if step == 0 {
                    waits_for = names;
                }
                let next_name = self.rover(next);
                if seen.contains(&next) {
                    text.push_str(&format!("{link}{next_name}: a circle"));
                    break;
                }
                let claim = sighted(next).and_then(|sighting| sighting.place.claim());
                let claim = claim.map_or_else(String::new, |vertex| format!(" at {vertex}"));
                text.push_str(&format!("{link}{next_name}{claim}"));
                seen.push(next);
                current = next;
                continue;
            }
            let (why, names) = self.without_rival(current, time_ns, sighted(current), sightings);
            if step == 0 {
                waits_for = names;
            }
            let link = if why.starts_with("waits") {
                if step == 0 { ", " } else { ", which " }
            } else {
                ", which "
            };
            if !why.is_empty() {
                text.push_str(&format!("{link}{why}"));
            }
            break;
        }
        if waits.locked.contains(&rover) {
            text.push_str("; it can never move again");
        }
        Wait { text, waits_for }
    }

    /// What keeps a rover that no other keeps: it drives, is down, or waits for a node.
    fn without_rival(
        &self,
        rover: u32,
        time_ns: u64,
        sighting: Option<&Sighting>,
        sightings: &[Sighting],
    ) -> (String, Vec<String>) {
        let name = self.rover(rover);
        if let Some(since_ns) = self.down_since(&name, time_ns) {
            return (format!("is down since {}", seconds(since_ns)), Vec::new());
        }
        let Some(sighting) = sighting else {
            return (String::new(), Vec::new());
        };
        let held: BTreeSet<VertexId> = sightings
            .iter()
            .filter_map(|other| other.place.claim())
            .collect();
        let wanted: Vec<VertexId> = match sighting.place {
            Place::Between(_, to) => return (format!("drives to {to}"), Vec::new()),
            Place::At(here) if here == sighting.goal => {
                return ("is at its goal".to_owned(), Vec::new());
            }
            Place::At(here) => nearer(&self.drawn.site.roadmap, here, sighting.goal).collect(),
            Place::Away => vec![sighting.entry],
        };
        let free = wanted.iter().find(|vertex| !held.contains(vertex));
        let Some(vertex) = free.or(wanted.first()) else {
            return ("has no way to its goal".to_owned(), Vec::new());
        };
        let node = self.node(self.drawn.site.sensors.owner(*vertex));
        let down = self.down_since(&node, time_ns);
        let down = down.map_or_else(String::new, |since| {
            format!(", down since {},", seconds(since))
        });
        let holder = sightings
            .iter()
            .find(|other| other.place.claim() == Some(*vertex));
        let text = match holder {
            None => format!("waits for {node}{down} to grant {vertex}, which is free"),
            Some(holder) => {
                let holder = self.rover(holder.rover);
                format!("waits for {node}{down} to grant {vertex}, which {holder} holds")
            }
        };
        (text, vec![node])
    }

    /// A node: who waited for it while it was down.
    fn of_node(&self, node: NodeId) -> Account {
        let mut account = Account::default();
        let name = self.node(node);
        let owned = self.drawn.site.sensors.owned(node).len();
        let text = format!("answers for {owned} vertices");
        account.push(active(0, self.until_ns, text));
        let mut account = self.with_outages(&name, account);
        for phase in account
            .phases
            .iter_mut()
            .filter(|phase| phase.doing == Doing::Down)
        {
            let waiting = self.waiting_for(&name, phase.until_ns.saturating_sub(1));
            if !waiting.is_empty() {
                phase
                    .text
                    .push_str(&format!("; at its end {} wait for it", waiting.join(", ")));
            }
        }
        account
    }

    /// The rovers that wait for a node to grant something.
    fn waiting_for(&self, node: &str, time_ns: u64) -> Vec<String> {
        let sightings = self.drawn.tracks.at(time_ns);
        let waits = self.drawn.waits(&sightings);
        let stands = sightings.iter().filter(|sighting| {
            let is_there = matches!(sighting.place, Place::At(here) if here != sighting.goal);
            is_there && !waits.on.contains_key(&sighting.rover)
        });
        let waits_for_it = stands.filter(|sighting| {
            let (_, names) =
                self.without_rival(sighting.rover, time_ns, Some(*sighting), &sightings);
            names.iter().any(|name| name == node)
        });
        waits_for_it
            .map(|sighting| self.rover(sighting.rover))
            .collect()
    }

    /// The same account, in which the actor is down while it is.
    fn with_outages(&self, actor: &str, account: Account) -> Account {
        let outages = self
            .drawn
            .tracks
            .outages
            .iter()
            .filter(|outage| outage.actor == actor);
        let spans = outages.map(|outage| (outage.from_ns, outage.to_ns));
        account.with_outages(spans, self.until_ns)
    }
}

fn active(from_ns: u64, until_ns: u64, text: String) -> Phase {
    Phase {
        from_ns,
        until_ns,
        doing: Doing::Active,
        text,
        waits_for: Vec::new(),
    }
}

fn seconds(time_ns: u64) -> farside::SimDuration {
    farside::SimDuration::from_nanos(time_ns)
}
