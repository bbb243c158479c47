//! Graphs of causes for Graphviz: <https://graphviz.org/doc/info/lang.html>.

use std::collections::BTreeMap;

use farside::record::RecordClass;
use farside_logs::{LoggedRecord, escaped};

use super::{Selected, event_text, number, seconds};

/// As many events as are drawn: more cannot be read.
const EVENTS: usize = 400;

/// A graph of causes, and what it shows.
pub(crate) struct Graph {
    pub(crate) text: String,
    pub(crate) told: String,
}

/// The graph of a selection: an arrow leads from each event to those that it caused.
pub(crate) fn graph(title: &str, selected: Selected) -> Graph {
    let Selected {
        mut records,
        mut remarks,
    } = selected;
    let more = records.len().saturating_sub(EVENTS);
    if more > 0 {
        records.truncate(EVENTS);
        remarks.push(format!(
            "{more} events behind the first {EVENTS} are left out: ask for a shorter time, or for some actors"
        ));
    }
    let key =
        |key: &farside_logs::LoggedKey| (key.time_ns, key.step, key.source.clone(), key.count);
    // A loss has the key of what caused it.
    let events = records.iter().enumerate();
    let events = events.filter(|(_, record)| record.class != RecordClass::Lost);
    let numbers: BTreeMap<_, usize> = events.map(|(at, record)| (key(&record.key), at)).collect();
    let mut text = format!(
        "digraph causes {{\n  label={}; labelloc=t; rankdir=TB;\n  node [shape=box, fontname=\"sans-serif\", \
         fontsize=10];\n",
        quoted(title)
    );
    let mut arrows = 0;
    for (at, record) in records.iter().enumerate() {
        let style = match record.class {
            RecordClass::Lost => ", color=\"#b3261e\", fontcolor=\"#b3261e\", style=dashed",
            RecordClass::Crash | RecordClass::Restart | RecordClass::Change | RecordClass::Stop => {
                ", shape=octagon"
            }
            RecordClass::Timer | RecordClass::Start => ", style=rounded",
            _ => "",
        };
        let label = quoted(&label(record));
        text.push_str(&format!("  e{at} [label={label}{style}];\n"));
    }
    for (at, record) in records.iter().enumerate() {
        let cause = record
            .cause
            .as_ref()
            .and_then(|cause| numbers.get(&key(cause)));
        if let Some(cause) = cause.filter(|cause| **cause != at) {
            text.push_str(&format!("  e{cause} -> e{at};\n"));
            arrows += 1;
        }
    }
    for remark in &remarks {
        text.push_str(&format!("  // {}\n", escaped(remark)));
    }
    text.push_str("}\n");
    let mut told = format!("{} events, {arrows} causes", records.len());
    for remark in &remarks {
        told.push_str(&format!("\n  {remark}"));
    }
    Graph { text, told }
}

fn label(record: &LoggedRecord) -> String {
    let at = seconds(record.key.time_ns);
    let (sender, receiver, kind) = (&record.sender, &record.receiver, &record.kind);
    let lost = match record.class {
        RecordClass::Lost => format!("\nlost: {}", record.reason),
        RecordClass::InFlight => "\nin flight at the end".to_owned(),
        RecordClass::HandOver => "\nreaches the link".to_owned(),
        _ => String::new(),
    };
    match record.class {
        RecordClass::Delivered
        | RecordClass::Lost
        | RecordClass::InFlight
        | RecordClass::HandOver => {
            let number = number(record);
            format!("{at} s\n{sender} → {receiver}\n{kind} {number}{lost}")
        }
        _ => {
            let text = event_text(record);
            format!("{receiver}\n{text}")
        }
    }
}

/// A text of Graphviz.
fn quoted(text: &str) -> String {
    let lines: Vec<String> = text
        .lines()
        .map(|line| escaped(line).replace('\\', "\\\\").replace('"', "\\\""))
        .collect();
    format!("\"{}\"", lines.join("\\n"))
}
