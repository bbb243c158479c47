//! How fast two logs of equal content are compared, against the MCAP library that only reads them,
//! and in how much memory. The logs have 64 MB each, or as many as are asked for:
//!
//! ```text
//! cargo bench -p farside-logs --bench diff -- 1024
//! ```
//!
//! Prints the ratio, of which the aim is 0.5, and the peak of the process, of which it is 300 MB; then
//! the same of two logs that have no record alike.

#[path = "shared/clock.rs"]
mod clock;
#[path = "shared/rovers.rs"]
mod rovers;

use std::io::Read;
use std::path::{Path, PathBuf};

use clock::{median, ratios, timed};
use farside_logs::{DiffOptions, DiffReport, LogOptions, LogWriter, diff};
use mcap::sans_io::{LinearReadEvent, LinearReader};
use rovers::simulate;

/// How often each of the two reads everything.
const PAIRS: usize = 5;

/// What a second of the run takes in its log, in bytes, about.
const BYTES_A_SECOND: u64 = 92_500;

fn compare([a, b]: &[PathBuf; 2]) -> DiffReport {
    diff(a, b, &DiffOptions::default()).unwrap()
}

fn create(path: &Path) -> LogWriter {
    // The machine is not compared.
    let host = [("host".to_owned(), path.display().to_string())].into();
    let options = LogOptions {
        host,
        ..LogOptions::default()
    };
    LogWriter::create(path, options).unwrap()
}

/// Reads all messages of a log as the MCAP library does; gives how many.
fn read_bare(path: &Path) -> u64 {
    let mut file = std::fs::File::open(path).unwrap();
    let mut reader = LinearReader::new();
    let mut messages = 0;
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(bytes) => {
                let read = file.read(reader.insert(bytes)).unwrap();
                reader.notify_read(read);
            }
            LinearReadEvent::Record { data, opcode } => {
                let record = mcap::parse_record(opcode, data).unwrap();
                messages += u64::from(matches!(record, mcap::records::Record::Message { .. }));
            }
        }
    }
    messages
}

/// The most memory that this process has had, in MB, where Linux says so.
fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    let kb: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kb / 1024.0)
}

fn main() {
    let asked = std::env::args().find_map(|arg| arg.parse::<u64>().ok());
    let megabytes = asked.unwrap_or(64);
    let folder = tempfile::tempdir().unwrap();
    let logs = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
    let writers = logs.each_ref().map(|path| create(path));
    let seconds = (megabytes << 20) / BYTES_A_SECOND + 1;
    simulate(writers, 1, seconds);
    let bytes: u64 = logs
        .iter()
        .map(|path| std::fs::metadata(path).unwrap().len())
        .sum();

    println!(
        "before:  {:.0} MB at most in memory",
        peak_mb().unwrap_or(f64::NAN)
    );
    let report = compare(&logs);
    assert!(report.identical, "{report}");
    println!(
        "after:   {:.0} MB at most in memory",
        peak_mb().unwrap_or(f64::NAN)
    );
    let mut pairs = Vec::new();
    // Interleaved, so that other work on the machine meets both.
    for _ in 0..PAIRS {
        let (_, ours) = timed(|| compare(&logs));
        let (_, peer) = timed(|| logs.each_ref().map(|path| read_bare(path)));
        pairs.push((ours, peer));
    }
    let rate = |wall_s: Vec<f64>| bytes as f64 / median(wall_s) / 1e6;
    let (ours, peer) = pairs
        .iter()
        .map(|(ours, peer)| (ours.wall_s, peer.wall_s))
        .unzip();
    println!(
        "{} records in each of two logs, {bytes} bytes in all",
        report.records_a
    );
    println!("farside: {:.1} MB/s compared", rate(ours));
    println!("mcap:    {:.1} MB/s read", rate(peer));
    let [wall, processor] = ratios(&pairs);
    println!("ratio:   {wall:.2} (median of {PAIRS} pairs); of processor time {processor:.2}");

    // Of another seed, every pose is another.
    simulate([create(&logs[1])], 2, seconds);
    let (report, took) = timed(|| compare(&logs));
    println!(
        "apart:   {:.0} MB at most in memory; {:.1} MB/s; {} records changed",
        peak_mb().unwrap_or(f64::NAN),
        bytes as f64 / took.wall_s / 1e6,
        report.changed
    );
}
