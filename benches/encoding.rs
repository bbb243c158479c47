//! How long encoding takes, beside prost's for the same bytes and serde_json's.
//!
//! `cargo bench -p farside --bench encoding` prints nanoseconds for each message and ratios. It
//! is no test: nothing depends on what it prints.

// A benchmark measures real time.
#![allow(clippy::disallowed_types)]

use std::hint::black_box;
use std::time::Instant;

use farside::encoding::Schema;
use prost::Message;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// The least of this many rounds counts: noise only ever adds.
const ROUNDS: usize = 25;

#[derive(Clone, Serialize, Deserialize, Message)]
struct Job {
    #[prost(uint64, tag = "1")]
    a: u64,
    #[prost(uint64, tag = "2")]
    b: u64,
    #[prost(uint64, tag = "3")]
    c: u64,
}

#[derive(Clone, Serialize, Deserialize, Message)]
struct Position {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    heading: f64,
}

#[derive(Clone, Serialize, Deserialize, Message)]
struct Waypoint {
    #[prost(uint32, tag = "1")]
    node: u32,
    #[prost(double, tag = "2")]
    arrive_s: f64,
    #[prost(message, required, tag = "3")]
    at: Position,
}

#[derive(Clone, Serialize, Deserialize, Message)]
struct Status {
    #[prost(string, tag = "1")]
    rover: String,
    #[prost(message, required, tag = "2")]
    position: Position,
    #[prost(double, tag = "3")]
    energy_joules: f64,
    #[prost(uint32, optional, tag = "4")]
    task: Option<u32>,
    #[prost(message, repeated, tag = "5")]
    route: Vec<Waypoint>,
    #[prost(uint64, repeated, tag = "6")]
    seen: Vec<u64>,
    #[prost(bool, tag = "7")]
    moving: bool,
}

#[derive(Clone, Serialize, Deserialize, Message)]
struct Bounds {
    #[prost(uint64, tag = "1")]
    iteration: u64,
    #[prost(double, repeated, tag = "2")]
    values: Vec<f64>,
}

/// Nanoseconds for each call, at best.
fn time(mut call: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    let mut calls = 16_u32;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        for _ in 0..calls {
            call();
        }
        let taken = start.elapsed().as_nanos() as f64;
        least = least.min(taken / f64::from(calls));
        if taken < 2e6 {
            calls *= 2;
        }
    }
    least
}

fn compare<T: Message + Serialize + DeserializeOwned + 'static>(label: &str, value: &T) {
    let schema = Schema::of::<T>().expect("the type has a schema");
    let mut out = Vec::with_capacity(1 << 16);
    schema
        .encode(value, &mut out)
        .expect("the value can be encoded");
    assert_eq!(out, value.encode_to_vec(), "both write the same bytes");
    let bytes = out.len();
    let ours = time(|| {
        out.clear();
        let done = schema.encode(black_box(value), &mut out);
        assert!(black_box(done).is_ok());
    });
    let prost = time(|| {
        out.clear();
        let done = black_box(value).encode(&mut out);
        assert!(black_box(done).is_ok());
    });
    let json = time(|| {
        out.clear();
        let done = serde_json::to_writer(&mut out, black_box(value));
        assert!(black_box(done).is_ok());
    });
    schema
        .encode(value, &mut out)
        .expect("the value can be encoded");
    let encoded = value.encode_to_vec();
    let decode = time(|| {
        assert!(black_box(schema.decode::<T>(black_box(&encoded))).is_ok());
    });
    println!(
        "{label:24} {bytes:6} B  ours {ours:8.1} ns  prost {prost:8.1} ns  json {json:8.1} ns  \
         ours/prost {:5.2}  ours/json {:5.2}  decode {decode:8.1} ns",
        ours / prost,
        ours / json,
    );
}

fn main() {
    compare("job, small numbers", &Job { a: 1, b: 2, c: 3 });
    let (a, b, c) = (0x12_3456_789a_bcde, 0x7654_3210_fedc, 0xffff_ffff_ffff);
    compare("job, 24 bytes", &Job { a, b, c });
    let at = Position {
        x: 1.5,
        y: -2.25,
        heading: 0.125,
    };
    let waypoint = |node: u32| Waypoint {
        node,
        arrive_s: f64::from(node) + 0.5,
        at: at.clone(),
    };
    let status = Status {
        rover: "rover_17".into(),
        position: at.clone(),
        energy_joules: 1234.5,
        task: Some(12),
        route: (1..9).map(waypoint).collect(),
        seen: (1..20).map(|n| n * n * n * 7919).collect(),
        moving: true,
    };
    compare("status, nested", &status);
    for len in [8_u32, 64, 512] {
        let values = (0..len).map(|n| f64::from(n) * 1.1).collect();
        compare(
            &format!("bounds, {len} doubles"),
            &Bounds {
                iteration: 3,
                values,
            },
        );
    }
}
