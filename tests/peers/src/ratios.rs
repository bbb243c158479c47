//! What simulators take beside each other, and what that should be.

use crate::Size;

const NEXOSIM: usize = 0;
const NS_3: usize = 2;
const INLINE: usize = 3;
const DIGEST: usize = 4;
const KAMEO: usize = 5;

/// A ratio's bound.
#[derive(Clone, Copy)]
enum Target {
    AtLeast(f64),
    AtMost(f64),
}

impl Target {
    fn say(self, ratio: Option<f64>) -> String {
        let (bound, limit, met) = match self {
            Target::AtLeast(limit) => ("at least", limit, ratio.map(|ratio| ratio >= limit)),
            Target::AtMost(limit) => ("at most", limit, ratio.map(|ratio| ratio <= limit)),
        };
        let ratio = ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.2}"));
        let verdict = match met {
            Some(true) => "met",
            Some(false) => "MISSED",
            None => "not measured",
        };
        format!("{ratio:>6}  {bound} {limit:.1}: {verdict}")
    }
}

/// Prints all ratios of these medians that have a target.
pub fn print(table: &[(Size, [Option<f64>; 6])]) {
    let line = |what: &str, size: &str, ratio: Option<f64>, target: Target| {
        println!("{what:<28} {size:>9} {}", target.say(ratio));
    };
    let over = |a: Option<f64>, b: Option<f64>| Some(a? / b?);
    for (size, ns) in table {
        let target = if size.actors < 1000 { 1.3 } else { 1.0 };
        let ratio = over(ns[NS_3], ns[INLINE]);
        line(
            "times as fast as ns-3, inline",
            &size.name(),
            ratio,
            Target::AtLeast(target),
        );
    }
    for (size, ns) in table {
        let ratio = over(ns[DIGEST], ns[INLINE]);
        line(
            "digest's time over inline's",
            &size.name(),
            ratio,
            Target::AtMost(1.5),
        );
    }
    for (size, ns) in table.iter().filter(|(_, ns)| ns[KAMEO].is_some()) {
        let ratio = over(ns[KAMEO], ns[INLINE]);
        line(
            "kameo's time over inline's",
            &size.name(),
            ratio,
            Target::AtMost(1.6),
        );
        let ratio = over(ns[NEXOSIM], ns[KAMEO]);
        line(
            "kameo's rate over NeXosim's",
            &size.name(),
            ratio,
            Target::AtLeast(2.0),
        );
    }
    let of = |actors| {
        let size = table.iter().find(|(size, _)| size.actors == actors);
        size.and_then(|(_, ns)| ns[INLINE])
    };
    let growth = over(of(100_000), of(128));
    line(
        "100,000x4's time over",
        "128x4",
        growth,
        Target::AtMost(3.0),
    );
}
