//! What each preset carries: the table in the docs of [`Preset`], counted anew.

use super::*;

/// So many messages of 500 bytes, at random times, so that they take this share of the rate.
const COUNT: u32 = 1000;
const LOADS: [(&str, f64); 3] = [("1/4", 0.25), ("1/2", 0.5), ("9/10", 0.9)];

/// A row of the table: of a preset at a load.
fn row(name: &str, params: &LinkParams, (load, share): (&str, f64)) -> String {
    let rate = params.rate.unwrap_or(1_000_000);
    let airtime_s = transmission_time(500 + params.overhead, rate).as_secs_f64();
    let mut stream = farside::random::RandomKey::new(11).stream();
    let mut at_s = 0.0;
    let sends = (0..COUNT).map(|_| {
        at_s += stream.exponential(airtime_s / share);
        let at = SimTime::ZERO + SimDuration::from_secs_f64(at_s);
        // The length of the padding takes two bytes.
        Send { at, pad: 497 }
    });
    let sends: Vec<Send> = sends.collect();
    let seen = over(1, &sends, Link::new(params.clone()));
    assert!(seen.iter().all(|fate| fate.bytes == 500));
    let mut delays: Vec<SimDuration> = arrived(&seen).iter().map(|fate| fate.delay).collect();
    delays.sort_unstable();
    let mean = delays.iter().map(|delay| delay.as_secs_f64()).sum::<f64>() / delays.len() as f64;
    let late = delays[delays.len() * 99 / 100].as_secs_f64();
    let shown = |seconds: f64| match seconds {
        ..0.001 => format!("{:.0} us", seconds * 1e6),
        ..1.0 => format!("{:.0} ms", seconds * 1e3),
        _ => format!("{seconds:.1} s"),
    };
    format!(
        "/// | `{name}` | {load} | {} | {} | {} |\n",
        delays.len(),
        shown(mean),
        shown(late),
    )
}

#[test]
fn the_docs_say_what_each_preset_carries() {
    let mut table = String::new();
    for preset in Preset::names().filter_map(Preset::find) {
        let params = preset.params();
        for load in LOADS {
            table += &row(preset.name(), &params, load);
        }
    }
    let docs = include_str!("../preset.rs");
    assert!(
        docs.contains(&table),
        "expected in the docs of Preset:\n{table}"
    );
}
