//! Max-plus over links with a bit rate. What a node says in one iteration is better than what it
//! said in the one before, and vectors that queue behind each other are old when they come, while
//! grants and beacons queue behind them. So a node computes no iteration before the vectors of the
//! last are on the air, by its own reckoning with the slowest link's rate, and does not send what
//! would not be on the air when the optimisation is over. Nothing changes where links have no rate.

use std::sync::LazyLock;

use farside::SimDuration;
use farside::encoding::{Schema, SchemaError};
use serde::Serialize;

use crate::max_plus::messages::{CandidatePaths, MaxPlus};
use crate::timing::Timing;

type LazySchema = LazyLock<Result<Schema, SchemaError>>;

static PATHS: LazySchema = LazyLock::new(Schema::of::<CandidatePaths>);
static VECTORS: LazySchema = LazyLock::new(Schema::of::<MaxPlus>);

/// How long candidate paths are on the air.
pub(super) fn paths_take(timing: &Timing, message: &CandidatePaths) -> SimDuration {
    takes(timing, &PATHS, message)
}

/// How long vectors are on the air.
pub(super) fn vectors_take(timing: &Timing, message: &MaxPlus) -> SimDuration {
    takes(timing, &VECTORS, message)
}

fn takes<M: Serialize>(timing: &Timing, schema: &LazySchema, message: &M) -> SimDuration {
    // Only a rate makes a size worth knowing.
    let (Some(_), Ok(schema)) = (timing.rate_bit_per_s, &**schema) else {
        return SimDuration::ZERO;
    };
    let mut bytes = Vec::new();
    // What cannot be encoded ends the run where it is recorded.
    let _ = schema.encode(message, &mut bytes);
    timing.sending(bytes.len() as u64)
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use farside::prelude::*;
    use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};

    use crate::testing::grid;
    use crate::{
        Missions, NetworkConfig, NetworkMetrics, Parts, TeamConfig, Timing, WorldConfig,
        assemble_over, missions,
    };
    use farside_actors::link::{Link, LinkParams};

    const LATENCY: SimDuration = SimDuration::from_millis(5);

    /// Of each message with vectors that came: when it was on the air, and how long it had waited.
    #[derive(Clone, Default)]
    struct Vectors(Arc<Mutex<Vec<(SimTime, SimDuration)>>>);

    impl Observer for Vectors {
        fn wants(&self) -> Wants {
            Wants::default()
        }

        fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
            let is_vectors = record.kind.is_some_and(|kind| kind.name() == "MaxPlus");
            if let Some(carriage) = record.carriage.filter(|_| is_vectors) {
                assert_eq!(record.class, RecordClass::Delivered);
                let on_air = SimTime::ZERO + (record.time().since(SimTime::ZERO) - LATENCY);
                self.0.lock().unwrap().push((on_air, carriage.queue));
            }
            Ok(Flow::Continue)
        }
    }

    /// So many rovers of four nodes over links with this rate.
    fn run(rovers: u32, rate: &str, network: &NetworkConfig) -> (NetworkMetrics, Timing, Vectors) {
        let map = grid(5, 4, &[(6, 7), (12, 13)]);
        let world = WorldConfig {
            nodes: 4,
            radius_m: Some(60.0),
            ..WorldConfig::default()
        };
        let sensors = Arc::new(world.place(&map, 1).unwrap());
        let mut sim = Simulation::new(1);
        let vectors = Vectors::default();
        sim.observe(vectors.clone());
        let params: LinkParams =
            toml::from_str(&format!("latency = '5ms'\nrate = '{rate}'")).unwrap();
        let missions = missions(&world, &map, &TeamConfig::of(rovers), 1).unwrap();
        let parts = Parts {
            world: &world,
            roadmap: Arc::new(map),
            sensors,
            config: network,
            terrain: None,
            only: &[],
        };
        let link = |_: &str, _: &str| Link::new(params.clone());
        let system = assemble_over(&mut sim, &parts, &Missions::Queued(missions), link).unwrap();
        let report = sim.run(Executor::Inline).unwrap();
        assert!(report.fault().is_none(), "{:?}", report.fault());
        (system.metrics(), system.timing(), vectors)
    }

    #[test]
    fn vectors_neither_queue_nor_come_too_late() {
        // So short that not all of them can come in time, and that not all rovers need arrive; and
        // nobody waits for anybody before the next iteration.
        let network = NetworkConfig {
            optimisation: Some(SimDuration::from_secs(1)),
            iteration_timeout: Some(SimDuration::from_millis(50)),
            ..NetworkConfig::default()
        };
        let (metrics, timing, vectors) = run(8, "1kbit/s", &network);
        assert_eq!(metrics.collisions, 0);
        let vectors = vectors.0.lock().unwrap();
        assert!(vectors.len() > 20, "{}", vectors.len());
        let cycle = timing.cycle.as_nanos();
        let ends = timing.decided_after() - timing.exchange;
        for (on_air, queued) in &*vectors {
            let at = SimDuration::from_nanos(on_air.as_nanos() % cycle);
            assert!(at <= ends, "{at} of a cycle, after {ends}");
            // A report of a rover's departure may be on the air.
            assert!(*queued <= timing.sending(64), "{queued} in a queue");
        }
    }

    #[test]
    fn slow_links_make_cycles_longer_and_teams_arrive() {
        let network = NetworkConfig::default();
        let (fast, _, _) = run(6, "10Mbit/s", &network);
        let (slow, timing, _) = run(6, "2kbit/s", &network);
        assert_eq!((fast.arrived, slow.arrived, slow.collisions), (6, 6, 0));
        assert!(
            timing.cycle > SimDuration::from_secs(20),
            "{}",
            timing.cycle
        );
        // Not many more of them, though each is so much longer.
        assert!(
            slow.cycles <= 2 * fast.cycles,
            "{} and {}",
            slow.cycles,
            fast.cycles
        );
    }
}
