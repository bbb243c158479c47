//! A channel: who is on the air, who hears whom, whose transmissions spoil each other.

use farside::SimTime;

/// A station's place in a radio's list.
pub(super) type Station = u32;

/// Someone on the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transmission {
    /// Which frame.
    pub(super) frame: u32,
    pub(super) from: Station,
    pub(super) to: Station,
    pub(super) start: SimTime,
    pub(super) end: SimTime,
    /// Something else was on the air that it could not stand against.
    pub(super) spoiled: bool,
}

/// What is on the air of one channel.
#[derive(Clone, Debug, Default)]
pub(super) struct Channel {
    on_air: Vec<Transmission>,
    /// When and by whom the channel was last used.
    last: Option<(SimTime, Station)>,
}

impl Channel {
    /// Until when the channel is in use at `now`, if it is, for whoever hears what `hears` says.
    pub(super) fn busy_until(
        &self,
        now: SimTime,
        hears: impl Fn(&Transmission) -> bool,
    ) -> Option<SimTime> {
        let audible = self.on_air.iter().filter(|t| t.end > now && hears(t));
        audible.map(|t| t.end).max()
    }

    /// When the channel was last free, and who had used it until then.
    pub(super) fn last_use(&self) -> Option<(SimTime, Station)> {
        self.last
    }

    /// Puts a transmission on the air. `spoils(victim, other)` says whether `victim` is lost to
    /// `other`; both begin to overlap now.
    pub(super) fn begin(
        &mut self,
        mut new: Transmission,
        spoils: impl Fn(&Transmission, &Transmission) -> bool,
    ) {
        for old in &mut self.on_air {
            // What ends as the other begins does not overlap.
            if old.end > new.start {
                old.spoiled |= spoils(old, &new);
                new.spoiled |= spoils(&new, old);
            }
        }
        self.on_air.push(new);
    }

    /// Takes a frame's transmission off the air; true if it was spoiled.
    pub(super) fn end(&mut self, frame: u32) -> bool {
        let Some(at) = self.on_air.iter().position(|t| t.frame == frame) else {
            debug_assert!(false, "a frame ends once, after it began");
            return true;
        };
        let ended = self.on_air.swap_remove(at);
        self.last = Some((ended.end, ended.from));
        ended.spoiled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent(frame: u32, start_s: u64, end_s: u64) -> Transmission {
        Transmission {
            frame,
            from: frame,
            to: 9,
            start: SimTime::from_secs(start_s),
            end: SimTime::from_secs(end_s),
            spoiled: false,
        }
    }

    #[test]
    fn overlap_spoils_and_touching_does_not() {
        let mut channel = Channel::default();
        channel.begin(sent(1, 0, 2), |_, _| true);
        channel.begin(sent(2, 1, 4), |_, _| true);
        assert!(channel.end(1));
        channel.begin(sent(3, 4, 5), |_, _| true);
        assert!(channel.end(2));
        assert!(!channel.end(3));
    }

    #[test]
    fn the_stronger_may_stand() {
        let mut channel = Channel::default();
        channel.begin(sent(1, 0, 2), |_, _| true);
        channel.begin(sent(2, 1, 4), |victim, _| victim.frame == 2);
        assert!(!channel.end(1));
        assert!(channel.end(2));
    }

    #[test]
    fn busy_is_what_is_heard() {
        let mut channel = Channel::default();
        channel.begin(sent(1, 0, 2), |_, _| false);
        channel.begin(sent(2, 0, 5), |_, _| false);
        let at = |s| SimTime::from_secs(s);
        assert_eq!(channel.busy_until(at(1), |_| true), Some(at(5)));
        assert_eq!(channel.busy_until(at(1), |t| t.from == 1), Some(at(2)));
        assert_eq!(channel.busy_until(at(2), |t| t.from == 1), None);
        assert_eq!(channel.busy_until(at(5), |_| true), None);
    }
}
