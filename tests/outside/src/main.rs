//! A system of somebody else's: beacons call, a lander counts. Demonstrates in particular that a
//! system brings all that is its own, settings, metrics, a curve, a scenario, a study, a picture, a
//! scene and what must never happen, in one file, and that the `farside` command speaks of it.
//!
//! ```text
//!   beacon_1 ──beacon_1-lander──▶ lander        Call, every interval
//!   beacon_2 ──beacon_2-lander──▶
//! ```

use farside::RunInfo;
use farside::prelude::*;
use farside_actors::prelude::*;
use farside_experiments::{cli, registry::Registry};
use serde::{Deserialize, Serialize};

settings! {
    /// The `[beacons]` table: who calls, and how often.
    struct Beacons {
        /// How many beacons there are.
        count: u32 = 2, 1..=100;
        /// How many times each calls.
        calls: u32 = 10, 1..=1000;
        /// The time between two calls.
        interval: SimDuration [with = "units::duration"] = SimDuration::from_secs(1),
            over(SimDuration::ZERO);
    }
}

#[derive(Serialize, Deserialize)]
struct Call {
    number: u32,
}

struct Beacon(Beacons);

impl Actor for Beacon {
    type Accepts = (Call,);
    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for number in 0..self.0.calls {
            ctx.timer(self.0.interval * u64::from(number + 1), Call { number });
        }
        Ok(())
    }
}

impl Handler<Call> for Beacon {
    fn handle(&mut self, call: Call, ctx: &mut Context<'_, Self>) -> Outcome {
        let lander = ctx.lookup::<Lander>("lander")?;
        ctx.send(lander, call);
        Ok(())
    }
}

struct Lander;

impl Actor for Lander {
    type Accepts = (Call,);
}

impl Handler<Call> for Lander {
    fn handle(&mut self, _: Call, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

#[derive(Debug)]
struct Calls;

impl Scene for Calls {
    fn record(&mut self, record: &Record<'_>, run: &RunInfo, out: &mut Vec<Drawing>) {
        if record.class == RecordClass::Delivered {
            out.push(Drawing::Text {
                level: Level::Info,
                name: run.name(record.sender).to_owned(),
                message: "calls".to_owned(),
            });
        }
    }
}

impl OwnTable for Beacons {
    const NAME: &'static str = "beacons";
    const ABOUT: &'static str = "beacons call a lander";
    const METRICS: &'static [Metric] = &[
        Metric::number("heard", "calls heard", "calls", Better::Higher),
        Metric::series(
            "heard_over_calls",
            "calls heard so far",
            "calls",
            SeriesIndex::new("call", ""),
            Better::Higher,
        ),
    ];
    const SCENARIOS: &'static [Builtin] = &[Builtin {
        name: "beacons/quiet",
        text: include_str!("../files/quiet.toml"),
    }];
    const STUDIES: &'static [Builtin] = &[Builtin {
        name: "beacons/loss",
        text: include_str!("../files/loss.toml"),
    }];
    const PICTURES: &'static [PictureInfo] = &[PictureInfo {
        name: "calls",
        about: "when calls were heard",
        takes: &[],
        extras: &[],
    }];

    const PROBLEM: Option<&'static str> = Some("how many beacons call, and how often, as a line");

    fn problem(&self, _setup: &mut Setup<'_>) -> Result<Option<String>, SetupError> {
        let calls = self.count * self.calls;
        Ok(Some(format!("{calls} calls of {} beacons.", self.count)))
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let (lander, mut wiring) = (setup.sim.host("lander"), Wiring::default());
        setup.sim.actor(lander, "lander", |_| Lander);
        for name in (1..=self.count).map(|number| format!("beacon_{number}")) {
            let (host, settings) = (setup.sim.host(&name), self.clone());
            setup
                .sim
                .actor(host, &name, move |_| Beacon(settings.clone()));
            wiring.link((host, &name), (lander, "lander"));
        }
        setup.link(&wiring)?;
        // When calls were heard [s], from the committed records.
        let heard = Gathered::default();
        let hears = heard.clone();
        setup.sim.observe(move |record: &Record<'_>| {
            if record.class == RecordClass::Delivered {
                hears.push(record.key.time.as_secs_f64());
            }
        });
        let settings = self.clone();
        let conclude = move |_: &Report| {
            let times = heard.take();
            let until = |call: u32| settings.interval.as_secs_f64() * f64::from(call + 2);
            let by = |call| times.iter().filter(|time| **time < until(call)).count() as f64;
            let mut results = Results::default().metric("heard", times.len()).metric(
                "heard_over_calls",
                Series::counted((0..settings.calls).map(by)),
            );
            results.line("calls heard", times.len().to_string());
            if times.is_empty() {
                results.violations.push("no call was heard".to_owned());
            }
            results
        };
        Ok(Assembly::new(conclude).with_scene(Calls))
    }

    fn draw(
        &self,
        _picture: &str,
        run: &dyn Recording,
        _request: &PictureRequest,
    ) -> Result<Figure, PictureError> {
        let mut times = Vec::new();
        let end = run.for_each(&mut |record| {
            let heard = record.class == RecordClass::Delivered;
            times.extend(heard.then_some(record.time_ns as f64));
            Ok(())
        })?;
        let scale = 400.0 / end.time_ns.unwrap_or(1).max(1) as f64;
        let points = times.iter().enumerate();
        let points = points.map(|(row, time)| (time * scale, 200.0 - 4.0 * row as f64));
        Ok(Figure {
            file: "calls.svg".to_owned(),
            title: format!("{} calls heard", times.len()),
            description: "Each call heard, over the time of the run.".to_owned(),
            width: 400.0,
            height: 200.0,
            body: maud::html! { path class="axis" d=(svg::path(points)) {} },
            facet: String::new(),
            style: "",
        })
    }
}

fn main() -> std::process::ExitCode {
    let registry = Registry::empty().with(Beacons::system());
    cli::main(registry.named("beacons", env!("CARGO_PKG_VERSION")))
}
