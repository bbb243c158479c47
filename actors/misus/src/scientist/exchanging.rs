//! What a scientist keeps of what was read, and how it exchanges it with the others.

use farside::prelude::*;
use farside_actors::rover::{CommandReport, Reading as Measured};

use super::touring::Logbook;
use super::{Instrument, Scientist};
use crate::analysis::exchange::{ExchangeError, Statistics};
use crate::analysis::reading::{Reading, TEXTURAL, Textural};
use crate::learning::Lesson;
use crate::messages::{ExchangeDue, LessonDue};

impl Handler<ExchangeDue> for Scientist {
    fn handle(&mut self, _: ExchangeDue, ctx: &mut Context<'_, Self>) -> Outcome {
        let site = self.site.clone();
        if site.is_in_contact(ctx.now()) {
            let round = self.round(ctx.now());
            for (number, name) in site.peers(self.number) {
                if let Some(statistics) = self.exchange.offer(number) {
                    let peer = ctx.lookup::<Scientist>(name)?;
                    ctx.send_keyed(peer, MatchKey::new(round, 0), statistics);
                }
            }
        }
        self.schedule_exchange(ctx);
        Ok(())
    }
}

impl Handler<LessonDue> for Scientist {
    fn handle(&mut self, _: LessonDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.learn(ctx);
        ctx.timer(self.site.config.learn_every, LessonDue);
        Ok(())
    }
}

impl Handler<Statistics> for Scientist {
    fn handle(&mut self, statistics: Statistics, _ctx: &mut Context<'_, Self>) -> Outcome {
        // What contradicts itself was damaged on its way, and comes again.
        if let Ok(received) = self.exchange.receive(&statistics) {
            self.is_to_learn |= received.added + received.revised > 0;
        }
        Ok(())
    }
}

/// A reading that was checked is refused for no reason but a bug.
fn refused(error: ExchangeError) -> HandlerError {
    HandlerError::new(error.to_string())
}

impl Scientist {
    /// How many exchanges there were before, counted by the clock.
    fn round(&self, now: SimTime) -> u32 {
        let every = self.site.config.exchange_every.as_nanos();
        u32::try_from(now.as_nanos() / every).unwrap_or(u32::MAX)
    }

    /// Sets the timer for the next exchange; all rovers exchange at the same instants.
    pub(super) fn schedule_exchange(&self, ctx: &mut Context<'_, Self>) {
        let every = self.site.config.exchange_every;
        let next = SimTime::ZERO + every * (u64::from(self.round(ctx.now())) + 1);
        ctx.timer(next.since(ctx.now()), ExchangeDue);
    }

    /// Keeps what a command has read. Of several readings of one rock by one kind of instrument
    /// the one with the least noise counts, so that coming by often does not make a rock sure.
    pub(super) fn keep(&mut self, report: &CommandReport) -> Outcome {
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
}

impl Scientist {
    /// Learns from all readings, if there are new ones, and records what it thinks then.
    pub(super) fn learn(&mut self, ctx: &mut Context<'_, Self>) {
        if !std::mem::take(&mut self.is_to_learn) {
            return;
        }
        let stops = ctx.durable::<Logbook>().stops;
        let rows = self.exchange.rows();
        self.lesson = Lesson::of(&self.site, &mut self.stories, rows);
        if let Some(lesson) = &self.lesson {
            let model = lesson.model(&self.site, self.exchange.rows().len(), stops);
            ctx.sample(&model);
        }
    }

    /// Of some rocks the one that the prioritiser values most, by all that is known now. Before
    /// anything is known there is nothing to choose by.
    pub(super) fn most_wanted(&mut self, ctx: &mut Context<'_, Self>, left: &[u32]) -> Option<u32> {
        self.learn(ctx);
        let wanted = |lesson: &Lesson| lesson.most_wanted(&self.site, left);
        self.lesson.as_ref().and_then(wanted)
    }
}
