//! The `[[crash]]` entries of a scenario: who crashes, when, and when it is back. By schedule, or
//! by chance: a fraction of a group, or each with a mean time between failures.

use farside::random::RandomKey;
use farside::{Pattern, SimDuration, SimTime, Simulation};
use farside_actors::{settings, units};

use farside::suggest::nearest;

/// The most crashes and restarts that one entry may plan.
const MAX_EVENTS: usize = 100_000;

settings! {
    /// A `[[crash]]` entry.
    ///
    /// | key | meaning | default |
    /// |---|---|---|
    /// | `actor` | a name, or a pattern over names (`node_*`) | needed, or `host` |
    /// | `host` | the same for hosts: all actors of a host crash at one instant | needed, or `actor` |
    /// | `fraction` | the share of those that match, rounded to whole ones | all |
    /// | `at` | when it crashes, or with `mtbf` from when on | needed; with `mtbf` 0 s |
    /// | `within` | it crashes at a time drawn evenly from `at` to `at + within` | at `at` |
    /// | `restart` | when it is started again | never |
    /// | `restart_after` | how long after the crash it is started again | never |
    /// | `mtbf` | it crashes again and again, each time after an exponential time of this mean | |
    /// | `mttr` | and is down for an exponential time of this mean | it stays down |
    ///
    /// Who is among the fraction and when it crashes are drawn by (run seed, entry, name): a larger
    /// fraction crashes the same ones at the same times, and more.
    ///
    /// ```
    /// use farside_experiments::scenario::Crash;
    /// let crash: Crash = toml::from_str("actor = 'node_*'\nfraction = '10%'\nat = '60s'")?;
    /// assert_eq!(crash.fraction, 0.1);
    /// # Ok::<(), toml::de::Error>(())
    /// ```
    pub struct Crash {
        /// The actor's name, or a pattern over actors' names.
        pub actor: Option<String> [skip_serializing_if = "Option::is_none"];
        /// The host's name, or a pattern over hosts' names: all actors of a host crash together.
        pub host: Option<String> [skip_serializing_if = "Option::is_none"];
        /// The share of those that match, rounded to whole ones.
        pub fraction: f64 [with = "units::fraction"] = 1.0;
        /// When it crashes, from the start of the run; with `mtbf`, from when on.
        pub at: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// How much later than `at` it may be: a time drawn evenly.
        pub within: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// When it is started again, from the start of the run; without, it stays down.
        pub restart: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// How long after the crash it is started again.
        pub restart_after: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// The mean time between failures: it crashes again and again, each time after an
        /// exponential time of this mean.
        pub mtbf: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// The mean time to repair: it is down for an exponential time of this mean.
        pub mttr: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
    }
}

/// When the crashes and the restarts of an entry are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Times {
    pub(super) down: Vec<SimDuration>,
    pub(super) up: Vec<SimDuration>,
}

/// What is wrong with an entry: the key to blame, what was found and what was expected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Mistake {
    pub(super) key: &'static str,
    pub(super) message: String,
}

fn mistake(key: &'static str, message: impl ToString) -> Mistake {
    Mistake {
        key,
        message: message.to_string(),
    }
}

impl Crash {
    /// Finds what can be found without knowing the actors.
    pub(super) fn check_alone(&self, until: Option<SimDuration>) -> Result<(), Mistake> {
        self.target()?;
        if self.at.is_none() && self.mtbf.is_none() {
            let message =
                "this key is missing: expected when it crashes, as in at = \"60s\", or `mtbf`";
            return Err(mistake("at", message));
        }
        if let Some(restart) = self.restart {
            let last = self.from() + self.within.unwrap_or(SimDuration::ZERO);
            if restart <= last {
                let message = format!("{restart}: expected a time after the crash at {last}");
                return Err(mistake("restart", message));
            }
            if self.restart_after.is_some() {
                let message = "expected `restart` or `restart_after`, not both";
                return Err(mistake("restart_after", message));
            }
        }
        if self.restart_after.is_some_and(SimDuration::is_zero) {
            return Err(mistake("restart_after", "0s: expected a time over zero"));
        }
        let (mut last, limit) = (self.from().as_nanos(), SimDuration::MAX);
        for (key, wait) in [
            ("within", self.within),
            ("restart_after", self.restart_after),
        ] {
            let wait = wait.unwrap_or(SimDuration::ZERO);
            let sum = last.checked_add(wait.as_nanos());
            last = sum.ok_or_else(|| {
                let since = SimDuration::from_nanos(last);
                let message = format!(
                    "{wait}: expected a time on the clock, which ends at {limit}, and counted \
                     from {since} it is none"
                );
                mistake(key, message)
            })?;
        }
        let Some(mtbf) = self.mtbf else {
            return match self.mttr {
                Some(_) => Err(mistake("mttr", "expected `mtbf` beside it")),
                None => Ok(()),
            };
        };
        let one_off = self
            .within
            .or(self.restart)
            .or(self.restart_after)
            .is_some();
        if one_off {
            let message = "expected no `within`, `restart` or `restart_after` beside it: \
                           it says when each crash and restart is";
            return Err(mistake("mtbf", message));
        }
        let Some(until) = until else {
            let message = "expected the scenario to have an `until`: crashes go on until then";
            return Err(mistake("mtbf", message));
        };
        let (mean, mttr) = (mtbf.as_secs_f64(), self.mttr.map(SimDuration::as_secs_f64));
        let often = until.as_secs_f64() / (mean + mttr.unwrap_or(0.0)).max(1e-9);
        if mtbf.is_zero() || mttr.is_some() && often > MAX_EVENTS as f64 / 4.0 {
            let limit = MAX_EVENTS / 4;
            let message = format!("{mtbf}: expected at most {limit} crashes until {until}");
            return Err(mistake("mtbf", message));
        }
        Ok(())
    }

    /// The key that says who crashes, and the pattern there.
    fn target(&self) -> Result<(&'static str, &str), Mistake> {
        match (&self.actor, &self.host) {
            (Some(actor), None) => Ok(("actor", actor)),
            (None, Some(host)) => Ok(("host", host)),
            (Some(_), Some(_)) => Err(mistake("host", "expected `actor` or `host`, not both")),
            (None, None) => {
                let message = "this key is missing: expected who crashes, as in \
                               actor = \"node_01\", or `host`";
                Err(mistake("actor", message))
            }
        }
    }

    fn from(&self) -> SimDuration {
        self.at.unwrap_or(SimDuration::ZERO)
    }

    /// Plans this entry's crashes and restarts, and says when they are; `index` is its place among
    /// the entries. Those before `from`, and from `to` on, are not planned.
    pub(super) fn plan(
        &self,
        sim: &mut Simulation,
        seed: u64,
        index: usize,
        until: Option<SimDuration>,
        (from, to): (SimDuration, Option<SimDuration>),
    ) -> Result<Times, Mistake> {
        let is_planned = |at: &SimDuration| *at >= from && to.is_none_or(|to| *at < to);
        let draws = |name: &str| {
            let key = RandomKey::new(seed).text("crash").number(index as u64);
            key.text(name)
        };
        let mut planned = Times::default();
        for name in self.chosen(sim, &draws)? {
            for (down, up) in self.times(&draws(&name), until) {
                let (down, up) = (Some(down).filter(is_planned), up.filter(is_planned));
                planned.down.extend(down);
                planned.up.extend(up);
                if planned.down.len() * 2 > MAX_EVENTS {
                    let message = format!("more than {MAX_EVENTS} crashes and restarts");
                    return Err(mistake("mtbf", message));
                }
                self.plan_one(sim, &name, down, up);
            }
        }
        Ok(planned)
    }

    /// Whether it goes on and on, so that a run that ends before the last of its crashes misses
    /// nothing that it was to show.
    pub(super) fn goes_on(&self) -> bool {
        self.mtbf.is_some()
    }

    /// Plans one crash of the actor or host called `name`, and its return.
    fn plan_one(
        &self,
        sim: &mut Simulation,
        name: &str,
        down: Option<SimDuration>,
        up: Option<SimDuration>,
    ) {
        let [down, up] = [down, up].map(|at| at.map(|at| SimTime::ZERO + at));
        if self.host.is_some() {
            let host = sim.host(name);
            if let Some(down) = down {
                sim.crash_host_at(down, host);
            }
            if let Some(up) = up {
                sim.restart_host_at(up, host);
            }
            return;
        }
        let crash = down.map_or(Ok(()), |down| sim.crash_named_at(down, name));
        let restart = up.map_or(Ok(()), |up| sim.restart_named_at(up, name));
        debug_assert!(
            crash.and(restart).is_ok(),
            "chosen among the actors there are"
        );
    }

    /// Who crashes: of those that match, the fraction with the least draws.
    fn chosen(
        &self,
        sim: &Simulation,
        draws: &dyn Fn(&str) -> RandomKey,
    ) -> Result<Vec<String>, Mistake> {
        let (key, found) = self.target()?;
        let pattern = Pattern::over_names(found)
            .map_err(|why| mistake(key, format!("{found:?} is no pattern over names: {why}")))?;
        let known: Vec<&str> = match key {
            "host" => sim.host_names().collect(),
            _ => sim.actor_names().collect(),
        };
        let names = known.iter().filter(|name| pattern.matches(name));
        let mut names: Vec<String> = names.map(|name| (*name).to_owned()).collect();
        if names.is_empty() {
            let hint = nearest(found, known.iter().copied());
            let hint = hint.map_or_else(String::new, |name| format!("; did you mean {name:?}?"));
            let count = known.len();
            let message = format!(
                "{found:?}: expected the name of one of {count} {key}s, or a pattern{hint}"
            );
            return Err(mistake(key, message));
        }
        names.sort_by(|a, b| {
            let draw = |name: &str| draws(name).text("chosen").uniform();
            draw(a).total_cmp(&draw(b)).then_with(|| a.cmp(b))
        });
        let count = libm::round(self.fraction * names.len() as f64);
        names.truncate(count as usize);
        Ok(names)
    }

    /// When one actor crashes and is back, crash by crash.
    fn times(
        &self,
        draws: &RandomKey,
        until: Option<SimDuration>,
    ) -> Vec<(SimDuration, Option<SimDuration>)> {
        let mut stream = draws.text("times").stream();
        let Some(mtbf) = self.mtbf else {
            let later = self.within.map_or(0.0, SimDuration::as_secs_f64) * stream.uniform();
            let down = self.from() + SimDuration::from_secs_f64(later);
            let up = self.restart.or(self.restart_after.map(|wait| down + wait));
            return vec![(down, up)];
        };
        let mut times = Vec::new();
        let until = until.unwrap_or(SimDuration::ZERO);
        let mut now = self.from();
        while times.len() < MAX_EVENTS {
            let down = now + SimDuration::from_secs_f64(stream.exponential(mtbf.as_secs_f64()));
            if down >= until {
                break;
            }
            let repair = self.mttr.map(|mean| stream.exponential(mean.as_secs_f64()));
            let up = repair.map(|wait| {
                down + SimDuration::from_secs_f64(wait).max(SimDuration::from_nanos(1))
            });
            times.push((down, up));
            match up {
                Some(up) => now = up,
                None => break,
            }
        }
        times
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crash(text: &str) -> Crash {
        toml::from_str(text).unwrap()
    }

    fn team() -> Simulation {
        struct Idle;
        impl farside::Actor for Idle {
            type Accepts = ();
        }
        let mut sim = Simulation::new(1);
        for name in (1..=20).map(|i| format!("node_{i:02}")) {
            let host = sim.host(&name);
            sim.actor(host, &name, |_| Idle);
        }
        sim
    }

    fn key(name: &str) -> RandomKey {
        RandomKey::new(9).text(name)
    }

    #[test]
    fn a_larger_fraction_crashes_the_same_actors_and_more() {
        let chosen = |fraction: f64| {
            let entry = crash(&format!("actor = 'node_*'\nfraction = {fraction}"));
            entry.chosen(&team(), &|name| key(name)).unwrap()
        };
        let (few, many) = (chosen(0.1), chosen(0.3));
        assert_eq!((few.len(), many.len(), chosen(0.0).len()), (2, 6, 0));
        assert!(few.iter().all(|name| many.contains(name)));
    }

    #[test]
    fn failures_and_repairs_have_their_means() {
        let entry = crash("actor = 'x'\nmtbf = '100s'\nmttr = '20s'");
        let until = SimDuration::from_secs(1_000_000);
        let times = entry.times(&key("x"), Some(until));
        let count = times.len() as f64;
        // A failure for each 120 s on average, with a standard error of about 1 %.
        assert!((count - 8333.0).abs() < 300.0, "{count}");
        let down = times.iter().map(|(down, up)| {
            let up = up.unwrap();
            assert!(up > *down);
            (up - *down).as_secs_f64()
        });
        let mean_down = down.sum::<f64>() / count;
        assert!((mean_down - 20.0).abs() < 1.0, "{mean_down}");
        assert!(times.windows(2).all(|pair| pair[0].1.unwrap() < pair[1].0));
    }

    #[test]
    fn one_crash_lies_within_its_window() {
        let entry = crash("actor = 'x'\nat = '10s'\nwithin = '5s'\nrestart_after = '2s'");
        for i in 0..100 {
            let times = entry.times(&key("x").number(i), None);
            let [(down, Some(up))] = times[..] else {
                panic!("one crash, one restart: {times:?}");
            };
            let window = SimDuration::from_secs(10)..=SimDuration::from_secs(15);
            assert!(window.contains(&down));
            assert_eq!(up, down + SimDuration::from_secs(2));
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let until = Some(SimDuration::from_secs(100));
        let wrong = |text: &str| crash(&format!("actor = 'x'\n{text}")).check_alone(until);
        let key = |text: &str| wrong(text).unwrap_err().key;
        assert_eq!(key("at = '5s'\nrestart = '5s'"), "restart");
        assert_eq!(key("at = '5s'\nwithin = '5s'\nrestart = '9s'"), "restart");
        assert_eq!(key("restart_after = '5s'"), "at");
        assert_eq!(key("at = '5s'\nmttr = '5s'"), "mttr");
        assert_eq!(key("mtbf = '5s'\nwithin = '1s'"), "mtbf");
        assert_eq!(key("mtbf = '0s'"), "mtbf");
        assert_eq!(key("mtbf = '1ns'\nmttr = '1ns'"), "mtbf");
        assert_eq!(key("at = '5s'\nrestart_after = '0s'"), "restart_after");
        assert_eq!(
            crash("actor = 'x'\nmtbf = '5s'")
                .check_alone(None)
                .unwrap_err()
                .key,
            "mtbf"
        );
        assert_eq!(wrong("mtbf = '5s'\nmttr = '1s'"), Ok(()));
        assert_eq!(key("at = '5s'\nhost = 'x'"), "host");
        let nobody = crash("at = '5s'").check_alone(until).unwrap_err();
        assert_eq!(nobody.key, "actor");
        assert_eq!(crash("at = '5s'\nhost = 'x'").check_alone(until), Ok(()));
    }

    #[test]
    fn hosts_are_chosen_by_name_and_an_unknown_one_is_named() {
        let chosen = |text: &str| crash(text).chosen(&team(), &|name| key(name));
        assert_eq!(chosen("host = 'node_07'\nat = '5s'").unwrap(), ["node_07"]);
        assert_eq!(chosen("host = 'node_*'\nat = '5s'").unwrap().len(), 20);
        let unknown = chosen("host = 'nod_07'\nat = '5s'").unwrap_err();
        assert_eq!(unknown.key, "host");
        let message = "\"nod_07\": expected the name of one of 20 hosts, or a pattern; \
                       did you mean \"node_07\"?";
        assert_eq!(unknown.message, message);
    }
}
