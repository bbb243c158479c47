//! Pages of logs.

use std::io::Read;
use std::path::Path;

use base64::Engine;
use farside::Executor;
use farside::ruling::MessageId;
use farside_logs::{LogOptions, LogWriter};
use serde_json::{Value as Json, json};

use super::{Side, columns, markup};
use crate::registry::Registry;
use crate::scenario::Scenario;

/// What would end a script or begin one, if it were taken for markup.
const HOSTILE: &str = "</script></title><script>window.hacked=1</script><!--\"'&amp;";

fn hostile() -> Side {
    let text = columns::block(HOSTILE.as_bytes());
    Side {
        head: json!({ "file": HOSTILE, "notes": [HOSTILE], "told": { "names": [HOSTILE] } }),
        rows: text.clone(),
        map: text.clone(),
        series: text.clone(),
        details: text,
        shown: 0,
        left_out: 0,
        asked: None,
        warnings: Vec::new(),
        is_behind_its_end: false,
    }
}

#[test]
fn nothing_that_a_log_says_is_taken_for_markup() {
    let side = hostile();
    let plain = markup::page("plain", &[&side, &side], &json!({ "file_a": HOSTILE }));
    let page = markup::page(HOSTILE, &[&side, &side], &json!({ "file_a": HOSTILE }));
    let count = |page: &str, tag: &str| page.matches(tag).count();
    for tag in [
        "<script",
        "</script",
        "<title",
        "</title",
        "<!--",
        "<style",
        "<noscript",
    ] {
        assert_eq!(count(&page, tag), count(&plain, tag), "{tag}");
    }
    assert!(!page.contains("window.hacked=1</script>"));
    // A head, four blocks a side, and the scripts.
    assert_eq!(count(&page, "<script"), 10);
    assert!(
        page.contains("&lt;/script&gt;"),
        "the title says it as text"
    );
}

#[test]
fn the_page_names_nothing_that_could_be_loaded() {
    let side = hostile();
    let page = markup::page("plain", &[&side], &json!(null));
    for loads in [
        "src=",
        "@import",
        "url(",
        "fetch(",
        "XMLHttpRequest",
        "import(",
        "WebSocket",
    ] {
        assert!(!page.contains(loads), "{loads}");
    }
    let links: Vec<&str> = page
        .split("href=\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .collect();
    assert_eq!(links, ["data:,"]);
    // One name of a standard and no address.
    assert_eq!(
        page.matches("http").count(),
        page.matches("http-equiv").count() + page.matches("http://www.w3.org/2000/svg").count()
    );
}

#[test]
fn scripts_end_no_script_and_make_no_markup_of_texts() {
    for script in markup::SCRIPTS {
        for wrong in [
            "</",
            "innerHTML",
            "outerHTML",
            "insertAdjacentHTML",
            "document.write",
            "eval(",
        ] {
            assert!(!script.contains(wrong), "{wrong}");
        }
    }
}

/// A row as the page's script reads it: class, sender, receiver and kind, its time, its cause, its ordinal.
struct Row {
    names: [String; 4],
    at_ns: u64,
    cause: Option<usize>,
    ordinal: u64,
}

/// The columns of a page, read as `assets/data.js` does it.
fn decoded(side: &Side) -> Vec<Row> {
    let packed = base64::engine::general_purpose::STANDARD.decode(&side.rows);
    let mut bytes = Vec::new();
    let packed = packed.unwrap();
    flate2::read::ZlibDecoder::new(packed.as_slice())
        .read_to_end(&mut bytes)
        .unwrap();
    let told = &side.head["told"];
    let mut rest = bytes.as_slice();
    let mut column = |length: &Json| {
        let (its, behind) = rest.split_at(length.as_u64().unwrap() as usize);
        rest = behind;
        let mut numbers = vec![0_u64];
        let mut shift = 0;
        for byte in its {
            *numbers.last_mut().unwrap() |= u64::from(byte & 0x7f) << shift;
            shift += 7;
            if byte & 0x80 == 0 {
                numbers.push(0);
                shift = 0;
            }
        }
        numbers.pop();
        numbers
    };
    let columns: Vec<Vec<u64>> = told["columns"]
        .as_array()
        .unwrap()
        .iter()
        .map(&mut column)
        .collect();
    let signed = |number: u64| (number >> 1) as i64 ^ -((number & 1) as i64);
    let unit_ns = told["unit_ns"].as_u64().unwrap();
    let mut at = 0_u64;
    let mut next = std::collections::BTreeMap::new();
    let row = |row: usize| {
        let flow = &told["flows"][columns[0][row] as usize];
        let name = |part: usize| {
            let number = flow[part].as_u64().unwrap() as usize;
            told["names"][number].as_str().unwrap().to_owned()
        };
        at = at.wrapping_add_signed(signed(columns[1][row]));
        let family: &mut u64 = next.entry(flow[6].as_u64()).or_default();
        let ordinal = family.wrapping_add_signed(signed(columns[4][row]));
        *family = ordinal + 1;
        Row {
            names: [0, 1, 2, 4].map(name),
            at_ns: at * unit_ns,
            cause: columns[3][row]
                .checked_sub(2)
                .map(|back| row - 1 - back as usize),
            ordinal,
        }
    };
    (0..columns[0].len()).map(row).collect()
}

/// A small log in which messages are lost.
fn log(path: &Path) {
    let sets = ["team.rovers=3", "until=3s", "links.default.loss=0.2"].map(str::to_owned);
    let scenario = Scenario::open("network/crater-dense", &sets, &Registry::builtin()).unwrap();
    let mut assembled = scenario.assemble().unwrap();
    let options = LogOptions {
        scenario: scenario.name().to_owned(),
        resolved: scenario.resolved().unwrap(),
        ..LogOptions::default()
    };
    assembled
        .sim
        .observe(LogWriter::create(path, options).unwrap());
    assembled.sim.run(Executor::Inline).unwrap();
}

/// What `farside_logs::causes` finds by keys in the log is what the page has by rows.
#[test]
fn causes_on_the_page_are_those_that_the_log_has() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    log(&path);
    let side = super::read(&path, super::Window::default()).unwrap();
    let rows = decoded(&side);
    assert_eq!(rows.len(), side.shown as usize);
    let is_message = |row: &&Row| ["delivered", "lost"].contains(&row.names[0].as_str());
    let (mut compared, mut lost) = (0, 0);
    for row in rows.iter().filter(is_message).step_by(17) {
        let [class, sender, receiver, kind] = &row.names;
        let id = format!("{sender},{receiver},{kind},{}", row.ordinal);
        let id: MessageId = id.parse().unwrap();
        let chain = farside_logs::causes(&path, &id, usize::MAX)
            .unwrap()
            .unwrap();
        let expected: Vec<(u64, String, String)> = chain.events[1..]
            .iter()
            .map(|event| &event.record)
            .map(|record| {
                (
                    record.key.time_ns,
                    record.receiver.clone(),
                    record.kind.clone(),
                )
            })
            .collect();
        let mut found: Vec<(u64, String, String)> = Vec::new();
        let (mut cause, mut before) = (row.cause, None);
        while let Some(at) = cause {
            let Row { names, at_ns, .. } = &rows[at];
            let repeats = names[0] == "timer" && before == Some(names);
            if !repeats {
                found.push((*at_ns, names[2].clone(), names[3].clone()));
            }
            (cause, before) = (rows[at].cause, Some(names));
        }
        assert_eq!(found, expected, "{id}");
        compared += 1;
        lost += u32::from(class == "lost");
    }
    assert!(
        compared > 20 && lost > 2,
        "{compared} compared, {lost} of them lost"
    );
}
