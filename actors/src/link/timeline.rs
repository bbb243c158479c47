//! What parameters a link has when: known in advance, so that a message sent now and transmitted
//! later meets what holds then.

use std::sync::Arc;

use farside::{SimDuration, SimTime};

use super::contacts::Window;
use super::{LinkChange, LinkOverrides, LinkParams, NO_CONTACT, OUTAGE};

/// The most contacts of one link that the log is told of: someone may repeat one each nanosecond.
const MAX_TOLD: usize = 10_000;

/// All parameters that a link will have, by the instant from which each set of them holds.
///
/// ```
/// use farside::{SimDuration, SimTime};
/// use farside_actors::link::{LinkParams, Timeline};
/// let out = LinkParams { outage: true, ..LinkParams::default() };
/// let timeline = Timeline::new(LinkParams::default())
///     .then(SimTime::ZERO + SimDuration::from_secs(60), out);
/// assert!(!timeline.at(SimTime::ZERO).outage);
/// assert!(timeline.at(SimTime::ZERO + SimDuration::from_secs(60)).outage);
/// ```
#[derive(Clone, Debug)]
pub struct Timeline {
    /// In order; the first holds from the start.
    pub(super) spans: Vec<Span>,
    /// Whether messages have to be followed, whatever holds when they are sent.
    followed: bool,
}

/// The parameters from one instant to the next.
#[derive(Clone, Debug)]
pub(super) struct Span {
    pub(super) from: SimTime,
    pub(super) params: LinkParams,
    /// Latency, jitter, loss, duplicates and outages only: nothing waits for anything.
    pub(super) plain: bool,
    /// The least time on the way, computed once.
    pub(super) floor: SimDuration,
}

/// A link that cannot transmit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Closed {
    pub(super) reason: &'static str,
    /// When to look again, if that makes sense.
    pub(super) until: Option<SimTime>,
}

impl Span {
    fn new(from: SimTime, params: LinkParams) -> Self {
        Span {
            from,
            plain: is_plain(&params),
            floor: params.least_way(params.latency),
            params,
        }
    }
}

/// Whether these parameters need neither a queue nor a history.
fn is_plain(params: &LinkParams) -> bool {
    // What is not named here is a property of transmissions that take no time, or of none.
    params.jitter_correlation == 0.0
        && !params.fifo
        && params.burst.is_none()
        && params.reorder == 0.0
        && params.corrupt == 0.0
        && params.ber == 0.0
        && params.rate.is_none()
        && params.trace.is_none()
        && params.contacts.is_none()
        && !params.store_and_forward
        && params.retries == 0
        && !params.is_followed()
}

impl Timeline {
    /// These parameters for ever.
    pub fn new(params: LinkParams) -> Self {
        Timeline {
            followed: params.is_followed(),
            spans: vec![Span::new(SimTime::ZERO, params)],
        }
    }

    /// The same, and other parameters from `from` on. Whatever came after is forgotten.
    #[must_use]
    pub fn then(mut self, from: SimTime, params: LinkParams) -> Self {
        self.spans.retain(|span| span.from < from);
        self.spans.push(Span::new(from, params));
        self.settle();
        self
    }

    /// The same, without any change from `from` on.
    #[must_use]
    pub(crate) fn cut_off(mut self, from: SimTime) -> Self {
        self.spans
            .retain(|span| span.from < from || span.from == SimTime::ZERO);
        self.settle();
        self
    }

    /// Replaces some parameters from `from` on, whatever else is to change later.
    pub fn replace_from(&mut self, from: SimTime, over: &LinkOverrides) {
        let at = self.index(from);
        if self.spans[at].from < from {
            let span = Span::new(from, self.spans[at].params.clone());
            self.spans.insert(at + 1, span);
        }
        for span in self.spans.iter_mut().filter(|span| span.from >= from) {
            *span = Span::new(span.from, span.params.with(over));
        }
        self.settle();
    }

    /// Keeping the order needs to know what arrived before it was asked for, and so does following
    /// messages.
    fn settle(&mut self) {
        self.followed = self.spans.iter().any(|span| span.params.is_followed());
        if self.spans.iter().any(|span| span.params.fifo) {
            for span in &mut self.spans {
                span.plain = false;
            }
        }
    }

    /// Whether messages have to be followed, whatever holds when they are sent.
    pub(super) fn is_followed(&self) -> bool {
        self.followed
    }

    /// The parameters at `at`.
    pub fn at(&self, at: SimTime) -> &LinkParams {
        &self.spans[self.index(at)].params
    }

    /// The parameters with the instants from which they hold.
    pub fn iter(&self) -> impl Iterator<Item = (SimTime, &LinkParams)> {
        self.spans.iter().map(|span| (span.from, &span.params))
    }

    /// What the log is told of contacts: when each opens and closes, as a planned change of
    /// `contact`. Contacts that repeat are told until `until`, and without it once.
    pub(crate) fn contact_changes(&self, until: Option<SimDuration>) -> Vec<(SimTime, LinkChange)> {
        let horizon = until.map_or(SimTime::MAX, |until| SimTime::ZERO + until);
        let mut changes = Vec::new();
        for (index, span) in self.spans.iter().enumerate() {
            let Some(contacts) = &span.params.contacts else {
                continue;
            };
            let end = self.end_of(index).unwrap_or(SimTime::MAX).min(horizon);
            let most = match until {
                Some(_) => MAX_TOLD,
                None => contacts.len(),
            };
            for window in contacts.from(span.from).take(most) {
                if window.start >= end {
                    break;
                }
                let open = window.start.max(span.from);
                changes.push((open, LinkChange::contact(Some(&window))));
                if window.end < end {
                    changes.push((window.end, LinkChange::contact(None)));
                }
            }
        }
        changes
    }

    /// The least delay over all parameters. Those of an outage count only if there are no others:
    /// nothing is delivered under them.
    pub fn min_delay(&self) -> SimDuration {
        let delays = |out: bool| {
            let spans = self
                .spans
                .iter()
                .filter(move |span| span.params.outage == out);
            spans.map(|span| span.params.min_delay()).min()
        };
        delays(false).or(delays(true)).unwrap_or_default()
    }

    /// The highest bit rate over all parameters \[bit/s\], outages left out as above; none if there
    /// is no bound.
    pub(super) fn fastest_bit_per_s(&self) -> Option<u64> {
        let rates = self.spans.iter().filter(|span| !span.params.outage);
        let rates = rates.map(|span| span.params.fastest_bit_per_s());
        rates.reduce(|a, b| Some(a?.max(b?))).flatten()
    }

    /// Whether transmissions take time, whatever parameters hold.
    pub(crate) fn takes_time(&self) -> bool {
        let timed = |params: &LinkParams| {
            let all_timed = |c: &super::Contacts| c.windows().iter().all(|w| w.rate.is_some());
            params.rate.is_some()
                || params.trace.is_some()
                || params.contacts.as_ref().is_some_and(all_timed)
        };
        self.spans.iter().all(|span| timed(&span.params))
    }

    /// The least time on the way over all parameters, without what a transmission takes.
    pub(super) fn least_way(&self) -> SimDuration {
        let spans = self.spans.iter().map(|span| span.params.least_way_of_all());
        spans.min().unwrap_or_default()
    }

    pub(super) fn index(&self, at: SimTime) -> usize {
        self.spans.partition_point(|span| span.from <= at).max(1) - 1
    }

    /// When the parameters that hold at `index` end.
    pub(super) fn end_of(&self, index: usize) -> Option<SimTime> {
        self.spans.get(index + 1).map(|span| span.from)
    }

    /// The contact at `at`, if the link has contacts and one is on.
    pub(super) fn window(&self, at: SimTime) -> Option<Window> {
        self.at(at)
            .contacts
            .as_ref()
            .and_then(|contacts| contacts.at(at))
    }

    /// Why the link cannot transmit at `at`, if it cannot.
    pub(super) fn closed(&self, at: SimTime) -> Option<Closed> {
        let index = self.index(at);
        let params = &self.spans[index].params;
        let end = self.end_of(index);
        if params.outage {
            return Some(Closed {
                reason: OUTAGE,
                until: end,
            });
        }
        let contacts = params.contacts.as_ref()?;
        if contacts.at(at).is_some() {
            return None;
        }
        let next = contacts.next_after(at);
        Some(Closed {
            reason: NO_CONTACT,
            until: next.into_iter().chain(end).min(),
        })
    }

    /// Where a transmission that may begin at `start` is cut before its `end`, and why.
    pub(super) fn cut(&self, start: SimTime, end: SimTime) -> Option<(SimTime, &'static str)> {
        let mut cut = None;
        let mut until = end;
        let first = self.index(start);
        for index in first..self.spans.len() {
            let span = &self.spans[index];
            let from = span.from.max(start);
            if from >= until {
                break;
            }
            if let Some(closed) = self.closed(from) {
                return Some((from, closed.reason));
            }
            let window = span.params.contacts.as_ref().and_then(|c| c.at(from));
            // A span may end sooner, and the next may know no contacts.
            let lasts = self.end_of(index).unwrap_or(SimTime::MAX);
            if let Some(window) = window.filter(|window| window.end < until.min(lasts)) {
                until = window.end;
                cut = Some((until, NO_CONTACT));
            }
        }
        cut
    }

    /// How often one looks for a window under the parameters at `index` before one gives up: a
    /// message that fits into none of a period's fits into none of the next.
    pub(super) fn patience(&self, index: usize) -> usize {
        let contacts = self.spans[index].params.contacts.as_ref();
        2 * contacts.map_or(0, |contacts| contacts.len()) + 4
    }
}

impl From<LinkParams> for Timeline {
    fn from(params: LinkParams) -> Self {
        Timeline::new(params)
    }
}

impl From<LinkParams> for Arc<Timeline> {
    fn from(params: LinkParams) -> Self {
        Arc::new(Timeline::new(params))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Contact, Contacts};
    use super::*;

    fn at(secs: u64) -> SimTime {
        SimTime::ZERO + SimDuration::from_secs(secs)
    }

    fn contact(start: u64, end: u64) -> Contact {
        Contact {
            start: SimDuration::from_secs(start),
            end: SimDuration::from_secs(end),
            rate: None,
            owlt: None,
        }
    }

    fn timeline() -> Timeline {
        let contacts = Contacts::new(vec![contact(0, 10), contact(20, 30)], None).unwrap();
        let passes = LinkParams {
            contacts: Some(contacts),
            ..LinkParams::default()
        };
        let out = LinkParams {
            outage: true,
            ..LinkParams::default()
        };
        Timeline::new(passes.clone())
            .then(at(25), out)
            .then(at(28), LinkParams::default())
            .then(at(40), passes)
    }

    #[test]
    fn it_says_when_it_is_closed_and_for_how_long() {
        let timeline = timeline();
        let closed = |secs| timeline.closed(at(secs));
        let no_contact = |until| {
            Some(Closed {
                reason: NO_CONTACT,
                until,
            })
        };
        assert_eq!(closed(5), None);
        assert_eq!(closed(10), no_contact(Some(at(20))));
        assert_eq!(closed(25).unwrap().until, Some(at(28)));
        assert_eq!(closed(30), None);
        assert_eq!(closed(40), no_contact(None));
    }

    #[test]
    fn transmissions_are_cut_where_the_link_closes() {
        let timeline = timeline();
        let cut = |start, end| timeline.cut(at(start), at(end));
        assert_eq!(cut(5, 10), None);
        assert_eq!(cut(5, 11), Some((at(10), NO_CONTACT)));
        assert_eq!(cut(21, 25), None);
        assert_eq!(cut(21, 26), Some((at(25), OUTAGE)));
        assert_eq!(cut(29, 40), None);
        assert_eq!(cut(29, 41), Some((at(40), NO_CONTACT)));
    }
}
