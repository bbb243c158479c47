//! What a scientist is apart from what it commands: it keeps what is read, exchanges it with the other
//! scientists, and learns from all of it. It lies within an actor, which hands it reports, messages and
//! timers.

use std::collections::BTreeMap;

use farside::prelude::*;
use farside_actors::rover::{CommandReport, Reading as Measured};

use crate::analysis::exchange::{Exchange, ExchangeError, Statistics};
use crate::analysis::objective::Stories;
use crate::analysis::reading::{Origin, Reading, ReadingId, TEXTURAL, Textural};
use crate::learning::{Lesson, stories};
use crate::messages::{ExchangeDue, FieldModel};
use crate::site::SharedSite;

/// Keeps, exchanges and learns.
pub(crate) struct Learner {
    site: SharedSite,
    number: u32,
    /// The other scientists, by number and name.
    peers: Vec<(u32, String)>,
    exchange: Exchange,
    /// The reading that stands for a rock and an instrument, with its noise: a better one replaces it.
    kept: BTreeMap<(u32, Instrument), (ReadingId, f64)>,
    /// Whether something was read or heard since the last lesson.
    is_to_learn: bool,
    lesson: Option<Lesson>,
    stories: Stories,
}

/// Which kind of instrument a reading is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Instrument {
    Camera,
    Spectrometer,
}

/// A reading that was checked is refused for no reason but a bug.
fn refused(error: ExchangeError) -> HandlerError {
    HandlerError::new(error.to_string())
}

impl Learner {
    /// The learner of this number: a rover's number, or one beyond.
    pub(crate) fn new(site: SharedSite, number: u32, peers: Vec<(u32, String)>) -> Learner {
        let stories = stories(site.side_m);
        Learner {
            site,
            number,
            peers,
            exchange: Exchange::new(Origin {
                rover: number,
                incarnation: 0,
            }),
            kept: BTreeMap::new(),
            is_to_learn: false,
            lesson: None,
            stories,
        }
    }

    /// Begins with nothing known. What others had heard of an earlier incarnation they give back.
    pub(crate) fn begin(&mut self, incarnation: u32) {
        self.exchange = Exchange::new(Origin {
            rover: self.number,
            incarnation,
        });
    }

    /// What was learnt last; none before anything is known.
    pub(crate) fn lesson(&self) -> Option<&Lesson> {
        self.lesson.as_ref()
    }

    /// How many readings are known.
    pub(crate) fn readings(&self) -> usize {
        self.exchange.rows().len()
    }

    /// How many exchanges there were before, counted by the clock.
    fn round(&self, now: SimTime) -> u32 {
        let every = self.site.config.exchange_every.as_nanos();
        u32::try_from(now.as_nanos() / every).unwrap_or(u32::MAX)
    }

    /// Tells all others what they may lack.
    pub(crate) fn exchange<A: Actor>(&mut self, ctx: &mut Context<'_, A>) -> Outcome {
        let round = self.round(ctx.now());
        for (number, name) in &self.peers {
            if let Some(statistics) = self.exchange.offer(*number) {
                let peer = ctx.recipient::<Statistics>(name)?;
                ctx.send_keyed(peer, MatchKey::new(round, 0), statistics);
            }
        }
        Ok(())
    }

    /// Sets the timer for the next exchange; all scientists exchange at the same instants.
    pub(crate) fn schedule_exchange<A: Handler<ExchangeDue>>(&self, ctx: &mut Context<'_, A>) {
        let every = self.site.config.exchange_every;
        let next = SimTime::ZERO + every * (u64::from(self.round(ctx.now())) + 1);
        ctx.timer(next.since(ctx.now()), ExchangeDue);
    }

    /// Takes what another one tells.
    pub(crate) fn hear(&mut self, statistics: &Statistics) {
        // What contradicts itself was damaged on its way, and comes again.
        if let Ok(received) = self.exchange.receive(statistics) {
            self.is_to_learn |= received.added + received.revised > 0;
        }
    }

    /// Keeps what a command has read. Of several readings of one rock by one kind of instrument
    /// the one with the least noise counts, so that coming by often does not make a rock sure.
    pub(crate) fn keep(&mut self, report: &CommandReport) -> Outcome {
        for measured in &report.readings {
            let Some((instrument, reading)) = self.reading_of(measured, report) else {
                continue;
            };
            let (key, noise) = ((reading.rock, instrument), measured.noise);
            let id = match self.kept.get(&key).copied() {
                Some((_, before)) if before <= noise => continue,
                Some((id, _)) => {
                    self.exchange.revise(id, reading).map_err(refused)?;
                    id
                }
                None => self.exchange.record(reading).map_err(refused)?,
            };
            self.kept.insert(key, (id, noise));
            self.is_to_learn = true;
        }
        Ok(())
    }

    /// What a measurement says of a rock; none if it is of the ground, or says nothing.
    fn reading_of(
        &self,
        measured: &Measured,
        report: &CommandReport,
    ) -> Option<(Instrument, Reading)> {
        let mut reading = Reading {
            rock: measured.rock?,
            position_m: [measured.east_m as f32, measured.north_m as f32],
            position_sd_m: report.pose.position_sigma_m as f32,
            diameter_m: measured.diameter_m as f32,
            ..Reading::default()
        };
        let instrument = if measured.spectrum.is_empty() {
            let texture = measured.texture.get(..TEXTURAL)?;
            let mut features = [0.0; TEXTURAL];
            for (feature, value) in features.iter_mut().zip(texture) {
                *feature = *value as f32;
            }
            let noise_sd = measured.noise as f32;
            reading.textural = Some(Textural { features, noise_sd });
            Instrument::Camera
        } else {
            // A spectrum in which nothing was reflected says nothing of what reflects.
            let features = self
                .site
                .tools
                .basis
                .features(&measured.spectrum, measured.noise);
            reading.spectral = Some(features.ok()?);
            Instrument::Spectrometer
        };
        reading.check().ok()?;
        Some((instrument, reading))
    }

    /// Learns from all readings, if there are new ones; what it thinks then.
    pub(crate) fn learn(&mut self, stops: u32) -> Option<FieldModel> {
        if !std::mem::take(&mut self.is_to_learn) {
            return None;
        }
        let rows = self.exchange.rows();
        self.lesson = Lesson::of(&self.site, &mut self.stories, rows);
        let lesson = self.lesson.as_ref()?;
        Some(lesson.model(&self.site, self.exchange.rows().len(), stops))
    }
}
