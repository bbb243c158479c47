//! Teams on links that lose, repeat, delay and reorder; rovers that join, leave and restart.

use std::collections::BTreeMap;

use farside::random::{RandomKey, Stream};
use proptest::prelude::*;

use super::*;
use crate::analysis::reading::Textural;

fn reading(stream: &mut Stream) -> Reading {
    Reading {
        rock: stream.below(5) as u32,
        position_m: [stream.uniform() as f32, stream.uniform() as f32],
        textural: stream.chance(0.5).then(|| Textural {
            features: [stream.uniform() as f32; 4],
            noise_sd: 0.01,
        }),
        ..Reading::default()
    }
}

/// Rovers, and messages between them that are under way.
struct Team {
    rovers: Vec<Exchange>,
    /// Whether a rover takes part.
    is_present: Vec<bool>,
    /// Recipient and message.
    under_way: Vec<(usize, Statistics)>,
    stream: Stream,
    loss: f64,
    most_writes: usize,
}

impl Team {
    fn new(rovers: usize, seed: u64, loss: f64, most_writes: usize) -> Team {
        let new = |rover| {
            let origin = Origin {
                rover: rover as u32,
                incarnation: 0,
            };
            Exchange::new(origin).with_writes_per_message(most_writes)
        };
        Team {
            rovers: (0..rovers).map(new).collect(),
            is_present: vec![true; rovers],
            under_way: Vec::new(),
            stream: RandomKey::new(seed).stream(),
            loss,
            most_writes,
        }
    }

    fn send(&mut self, from: usize, to: usize) -> bool {
        let Some(message) = self.rovers[from].offer(to as u32) else {
            return false;
        };
        assert!(message.writes() <= self.most_writes);
        if self.is_present[from] && !self.stream.chance(self.loss) {
            self.under_way.push((to, message.clone()));
            if self.stream.chance(0.2) {
                self.under_way.push((to, message));
            }
        }
        true
    }

    fn deliver_any(&mut self) {
        if self.under_way.is_empty() {
            return;
        }
        let which = self.stream.below(self.under_way.len() as u64) as usize;
        let (to, message) = self.under_way.swap_remove(which);
        if self.is_present[to] {
            self.rovers[to].receive(&message).unwrap();
        }
    }

    /// Everyone offers to everyone, and all that is not lost arrives. Whether anyone had anything
    /// to say.
    fn round(&mut self) -> bool {
        let mut spoke = false;
        for from in 0..self.rovers.len() {
            for to in (0..self.rovers.len()).filter(|&to| to != from) {
                if self.is_present[from] && self.is_present[to] {
                    spoke |= self.send(from, to);
                }
            }
        }
        while !self.under_way.is_empty() {
            self.deliver_any();
        }
        spoke
    }

    fn something_happens(&mut self) {
        let rovers = self.rovers.len() as u64;
        let (a, b) = (self.stream.below(rovers), self.stream.below(rovers));
        let (a, b) = (a as usize, b as usize);
        match self.stream.below(20) {
            0..5 => {
                let reading = reading(&mut self.stream);
                self.rovers[a].record(reading).unwrap();
            }
            5..8 => {
                let me = self.rovers[a].origin();
                let own = |row: &&Row| row.id.origin == me;
                let ids: Vec<ReadingId> = self.rovers[a]
                    .rows()
                    .filter(own)
                    .map(|row| row.id)
                    .collect();
                if let Some(&id) = self.stream.choose(&ids) {
                    let reading = reading(&mut self.stream);
                    self.rovers[a].revise(id, reading).unwrap();
                }
            }
            8..13 if a != b => {
                self.send(a, b);
            }
            13..18 => self.deliver_any(),
            18 => {
                let Origin { rover, incarnation } = self.rovers[a].origin();
                let next = Origin {
                    rover,
                    incarnation: incarnation + 1,
                };
                self.rovers[a] = Exchange::new(next).with_writes_per_message(self.most_writes);
            }
            _ => self.is_present[a] = !self.is_present[a],
        }
    }

    /// The latest version of each reading that anyone has, found without the code under test.
    fn latest(&self) -> BTreeMap<ReadingId, Row> {
        let mut latest: BTreeMap<ReadingId, Row> = BTreeMap::new();
        for row in self.rovers.iter().flat_map(Exchange::rows) {
            let known = latest.entry(row.id).or_insert(*row);
            if row.version > known.version {
                *known = *row;
            }
        }
        latest
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn all_agree_in_the_end(
        rovers in 2usize..5,
        seed: u64,
        loss in 0.0f64..0.9,
        most_writes in 1usize..8,
        events in 0usize..300,
    ) {
        let mut team = Team::new(rovers, seed, loss, most_writes);
        for _ in 0..events {
            team.something_happens();
        }
        team.is_present.fill(true);
        while !team.under_way.is_empty() {
            team.deliver_any();
        }
        let latest = team.latest();
        let mut rounds = 0;
        while team.round() {
            rounds += 1;
            prop_assert!(rounds < 5_000, "still talking");
        }
        for rover in &team.rovers {
            prop_assert!(rover.rows().eq(latest.values()));
        }
    }

    /// Who is out of reach of half of the team hears of it through the other half.
    #[test]
    fn rows_pass_through_others(seed: u64, loss in 0.0f64..0.8) {
        let mut team = Team::new(3, seed, loss, 4);
        for _ in 0..20 {
            for rover in 0..3 {
                let reading = reading(&mut team.stream);
                team.rovers[rover].record(reading).unwrap();
            }
        }
        for _ in 0..400 {
            for (from, to) in [(0, 1), (1, 0), (1, 2), (2, 1)] {
                team.send(from, to);
                team.deliver_any();
            }
        }
        let latest = team.latest();
        prop_assert_eq!(latest.len(), 60);
        for rover in &team.rovers {
            prop_assert!(rover.rows().eq(latest.values()));
        }
    }

    /// Whatever order messages come in and however often, the rows are the same.
    #[test]
    fn order_and_repetition_do_not_matter(seed: u64, events in 1usize..100) {
        let mut team = Team::new(3, seed, 0.0, 3);
        let mut messages = Vec::new();
        for _ in 0..events {
            let before = team.under_way.len();
            team.something_happens();
            let sent = team.under_way.iter().skip(before);
            messages.extend(sent.map(|(_, message)| message.clone()));
        }
        // Rows behind a gap are not taken, so what fills it may have to come first.
        let listener = |messages: &[Statistics]| {
            let mut listener = Exchange::new(Origin { rover: 9, incarnation: 0 });
            for message in std::iter::repeat_n(messages, messages.len() + 1).flatten() {
                listener.receive(message).unwrap();
            }
            listener.rows().copied().collect::<Vec<_>>()
        };
        let once = listener(&messages);
        messages.extend(messages.clone());
        team.stream.shuffle(&mut messages);
        prop_assert_eq!(once, listener(&messages));
    }
}

#[test]
fn one_round_without_loss_is_enough() {
    let mut team = Team::new(4, 1, 0.6, WRITES_PER_MESSAGE);
    for _ in 0..15 {
        for rover in 0..4 {
            let reading = reading(&mut team.stream);
            team.rovers[rover].record(reading).unwrap();
        }
        team.round();
    }
    team.loss = 0.0;
    team.round();
    let latest = team.latest();
    for rover in &team.rovers {
        assert!(rover.rows().eq(latest.values()));
    }
}

#[test]
fn a_restarted_rover_is_told_everything_again() {
    let mut team = Team::new(2, 1, 0.0, WRITES_PER_MESSAGE);
    let first = reading(&mut team.stream);
    team.rovers[0].record(first).unwrap();
    while team.round() {}
    team.rovers[0] = Exchange::new(Origin {
        rover: 0,
        incarnation: 1,
    });
    let second = reading(&mut team.stream);
    team.rovers[0].record(second).unwrap();
    while team.round() {}
    for rover in &team.rovers {
        let readings: Vec<Reading> = rover.rows().map(|row| row.reading).collect();
        assert_eq!(readings, [first, second]);
    }
}

#[test]
fn what_contradicts_itself_is_refused_whole() {
    let me = Origin::default();
    let other = Origin {
        rover: 1,
        incarnation: 0,
    };
    let mut rover = Exchange::new(me);
    let message = |origin, after, reading| Statistics {
        from: other,
        spans: vec![Span {
            origin,
            after,
            writes: vec![
                Write::default(),
                Write {
                    ordinal: 1,
                    reading,
                },
            ],
        }],
        ..Statistics::default()
    };
    let refused = |rover: &mut Exchange, message: &Statistics| {
        let error = rover.receive(message).unwrap_err().to_string();
        assert_eq!(rover.rows().len(), 0);
        error
    };
    let plain = Reading::default();
    assert_eq!(
        refused(&mut rover, &message(other, u32::MAX - 1, plain)),
        "writes of Origin { rover: 1, incarnation: 0 } end at 4294967296, must end at 4294967295 \
         at most"
    );
    assert_eq!(
        refused(&mut rover, &message(me, 0, plain)),
        "Origin { rover: 1, incarnation: 0 } has write 2 of Origin { rover: 0, incarnation: 0 }, \
         which has made 0"
    );
    let broken = Reading {
        position_sd_m: f32::NAN,
        ..plain
    };
    assert_eq!(
        refused(&mut rover, &message(other, 0, broken)),
        "the reading of rock 0 has the position_sd_m NaN, must be finite and at least 0"
    );
    let foreign = ReadingId {
        origin: other,
        ordinal: 0,
    };
    assert!(matches!(
        rover.revise(foreign, Reading::default()),
        Err(ExchangeError::NotMine { .. })
    ));
    let unknown = ReadingId {
        origin: me,
        ordinal: 0,
    };
    assert!(matches!(
        rover.revise(unknown, Reading::default()),
        Err(ExchangeError::Unknown { .. })
    ));
}

#[test]
fn messages_are_encoded_and_come_back() {
    let schema = farside::encoding::Schema::of::<Statistics>().unwrap();
    let mut rover = Exchange::new(Origin::default());
    let mut stream = RandomKey::new(3).stream();
    for _ in 0..WRITES_PER_MESSAGE {
        rover.record(reading(&mut stream)).unwrap();
    }
    let message = rover.offer(1).unwrap();
    let mut bytes = Vec::new();
    schema.encode(&message, &mut bytes).unwrap();
    assert_eq!(schema.decode::<Statistics>(&bytes).unwrap(), message);
    assert!(bytes.len() < 5_500, "{} bytes", bytes.len());
}
