//! `view` and `diff --html`: what they write, and their pages in a browser.

use std::path::Path;

use serde_json::{Value, json};

use crate::browser::{Browser, installed, number};
use crate::common::{farside, json as printed, skip, small, text};

/// A page in a browser of this width, or why there is none.
fn opened(page: &Path, width: u32, scheme: &str) -> Option<Browser> {
    match installed() {
        Ok(program) => {
            let mut browser = Browser::start(&program, width, scheme);
            browser.open(page);
            Some(browser)
        }
        Err(why) => {
            skip("a page in a browser", why);
            None
        }
    }
}

fn run(folder: &Path, name: &str, more: &[&str]) {
    let output = farside(folder, &small(&[&["--out", name], more].concat()));
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// Where on the window the mark of a row of this class is, and when it is, in nanoseconds.
fn mark(browser: &mut Browser, class: &str) -> [f64; 3] {
    let found = browser.value(&format!(
        "(() => {{ const {{ sequence, state }} = farside; const side = state.side; \
         document.getElementById('lanes').scrollIntoView({{ block: 'center', behavior: 'instant' }}); \
         const box = document.getElementById('sequence').getBoundingClientRect(); \
         const near = (a, b) => Math.hypot(a.x - b.x, a.y - b.y) < 14; \
         const mark = sequence.marks.find((mark) => side.flow(mark.row).cls === {class:?} && mark.y > 40 \
            && mark.y < box.height - 10 && sequence.marks.filter((other) => near(mark, other)).length === 1); \
         return mark && [box.x + mark.x, box.y + mark.y, side.rows.at[mark.row]]; }})()"
    ));
    assert!(found.is_array(), "no {class} that stands alone");
    [0, 1, 2].map(|at| number(&found[at]))
}

#[test]
fn a_loss_is_chosen_its_causes_are_followed_and_the_slider_goes_with_them() {
    let folder = tempfile::tempdir().unwrap();
    run(
        folder.path(),
        "run.mcap",
        &["--set", "links.default.loss=0.1"],
    );
    let output = farside(
        folder.path(),
        &["view", "run.mcap", "--html", "v.html", "--json"],
    );
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(printed(&output)["only_counted"], 0);
    for (width, scheme) in [(390, "light"), (1600, "dark")] {
        let Some(mut browser) = opened(&folder.path().join("v.html"), width, scheme) else {
            return;
        };
        let wide = browser.value("document.documentElement.scrollWidth");
        assert!(number(&wide) <= f64::from(width), "{width}: {wide} wide");
        // A click on a cross of the chart.
        browser.value("farside.state.setView(2e9, 2.6e9)");
        browser.wait("farside.sequence.marks.length > 5");
        let [x, y, at_ns] = mark(&mut browser, "lost");
        browser.click(x, y);
        browser.wait("document.querySelectorAll('#chain li').length > 0");
        let title = browser.value("document.getElementById('selected').textContent");
        assert!(title.as_str().unwrap().contains("lost: loss"), "{title}");
        let slider = |browser: &mut Browser| {
            number(&browser.value("Number(document.getElementById('slider').value)"))
        };
        assert!(
            (slider(&mut browser) - at_ns).abs() < 1.0,
            "{width}: {at_ns}"
        );
        browser.wait("document.querySelector('.command').textContent.includes('--deliver')");
        // Back to the root, step by step: the time goes back with it.
        browser.click_on("#chain li:last-child button");
        browser.wait("document.getElementById('message').textContent.includes('It has no cause')");
        assert!(slider(&mut browser) < at_ns, "{width}");
        // The slider, by mouse and by keys.
        browser.click_on("#slider");
        let middle = number(&browser.value("farside.state.until / 2"));
        assert!(
            (slider(&mut browser) - middle).abs() < middle * 0.05,
            "{width}"
        );
        let said = browser.value("document.getElementById('now').textContent");
        assert!(said.as_str().unwrap().starts_with("5.0"), "{said}");
        let before = slider(&mut browser);
        browser.press("ArrowRight");
        assert!(slider(&mut browser) > before, "{width}");
        browser.press("l");
        browser.wait("document.getElementById('selected').textContent.includes('lost')");
        browser.click_on("#play");
        let stood = slider(&mut browser);
        browser.wait(&format!("farside.state.time > {stood}"));
        assert_eq!(browser.complaints, Vec::<String>::new(), "{width}");
    }
}

#[test]
fn filters_leave_out_what_is_not_asked_for_and_a_map_moves() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "run.mcap", &[]);
    assert!(
        farside(folder.path(), &["view", "run.mcap"])
            .status
            .success()
    );
    let Some(mut browser) = opened(&folder.path().join("run.html"), 1600, "light") else {
        return;
    };
    let pixels = "document.getElementById('map-a').toDataURL().length + ' ' + document.getElementById('map-a').toDataURL().slice(-4000)";
    let before = browser.value(pixels);
    browser.value("farside.state.setTime(9e9)");
    browser
        .value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))");
    assert_ne!(browser.value(pixels), before);
    browser.value("document.getElementById('actors').focus()");
    for letter in ["r", "o", "v", "e", "r", "_", "0", "1"] {
        browser.press(letter);
    }
    browser.wait("farside.sequence.lanes[farside.sequence.lanes.length - 1] === 'rover_01'");
    let only = "farside.sequence.marks.every(({ row }) => { const f = farside.state.side.flow(row); \
                return [f.sender, f.receiver].includes('rover_01'); })";
    browser.wait(only);
    // Each button and field says what it is, and can be reached by the keyboard.
    let nameless = browser.value(
        "[...document.querySelectorAll('button, select, input, canvas[tabindex], [role=application]')].filter((e) => \
         !e.textContent.trim() && !e.getAttribute('aria-label') && !e.getAttribute('aria-labelledby') \
         && !e.labels?.length).map((e) => e.outerHTML)",
    );
    assert_eq!(nameless, json!([]));
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn two_runs_are_on_one_page_with_what_differs() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "a.mcap", &[]);
    let fork = [
        "fork", "a.mcap", "--at", "4s", "--crash", "node_14", "--out", "b.mcap",
    ];
    assert_eq!(farside(folder.path(), &fork).status.code(), Some(1));
    let diff = ["diff", "a.mcap", "b.mcap", "--html", "d.html", "--json"];
    let output = farside(folder.path(), &diff);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let report: Value = printed(&output);
    let first_ns = number(&report["first"]["time_ns"]);
    let Some(mut browser) = opened(&folder.path().join("d.html"), 1600, "light") else {
        return;
    };
    let said = browser.value("document.getElementById('difference').textContent");
    assert!(
        said.as_str().unwrap().contains("The first difference: 4 s"),
        "{said}"
    );
    browser.click_on("#difference .first button[aria-label='Show it in B']");
    browser.wait("farside.state.index === 1 && farside.state.selected !== null");
    assert_eq!(number(&browser.value("farside.state.time")), first_ns);
    let title = browser.value("document.getElementById('selected').textContent");
    assert!(title.as_str().unwrap().contains("node_14"), "{title}");
    // Each message that differs is marked, and none before the fork.
    let differing = "farside.state.sides.map((side) => [side.told.differing, side.rows.differs.reduce((n, d) => n + d, 0), \
                     side.rows.at[side.rows.differs.indexOf(1)]])";
    let differing = browser.value(differing);
    for (side, only) in ["only_in_a", "only_in_b"].into_iter().enumerate() {
        let [told, marked, first] = [0, 1, 2].map(|at| number(&differing[side][at]));
        let expected = number(&report[only]) + number(&report["changed"]);
        assert!(
            told == marked && marked >= expected && first >= 4e9,
            "{differing} {expected}"
        );
        assert!(
            marked <= expected + number(&report["reordered"]),
            "{differing} {report}"
        );
    }
    browser.click_on("#differing");
    browser.wait(
        "farside.sequence.shown().list.every((row) => farside.state.side.rows.differs[row] === 1)",
    );
    browser.press("d");
    browser.wait("farside.state.side.rows.differs[farside.state.selected.row] === 1");
    browser.click_on("#differing");
    browser.click_on("input[name=side][value='0']");
    browser.wait("farside.state.index === 0");
    assert!(number(&browser.value("farside.state.reached.size")) > 1.0);
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// A part of a run has what happened in it, at the times of the run, and the map as it was by then.
#[test]
fn a_part_of_a_run_is_shown_from_where_things_stood() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "run.mcap", &[]);
    let view = |html: &str, span: &[&str]| {
        let args = [&["view", "run.mcap", "--html", html, "--json"], span].concat();
        farside(folder.path(), &args)
    };
    let whole = printed(&view("whole.html", &[]));
    let output = view("part.html", &["--from", "4s", "--at", "6500ms"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let part = printed(&output);
    assert!(
        number(&part["shown"]) < number(&whole["shown"]) / 2.0,
        "{part} {whole}"
    );
    assert!(
        part["notes"][0]
            .as_str()
            .unwrap()
            .contains("from 4s to 6.5s"),
        "{part}"
    );
    // Nobody is warned of what was asked for.
    assert_eq!(text(&output.stderr), "");
    for span in [
        ["--from", "5s", "--at", "4s"],
        ["--from", "99h", "--at", "100h"],
    ] {
        let output = view("none.html", &span);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
        assert!(!folder.path().join("none.html").exists());
    }
    let times = "[...farside.state.side.rows.at].map((at) => at + farside.state.side.head.from_ns)";
    let Some(mut browser) = opened(&folder.path().join("whole.html"), 1600, "light") else {
        return;
    };
    let all = browser.value(times);
    let all = all.as_array().unwrap().iter().map(number);
    let within: Vec<f64> = all.filter(|at| (4e9..=6.5e9).contains(at)).collect();
    let places = "JSON.stringify(farside.state.sides[0].map.frames.map((frame) => frame.name))";
    let frames = browser.value(places);
    let mut browser = opened(&folder.path().join("part.html"), 390, "dark").unwrap();
    let shown = browser.value(times);
    let shown: Vec<f64> = shown.as_array().unwrap().iter().map(number).collect();
    assert_eq!(shown, within);
    assert_eq!(browser.value(places), frames);
    let said = browser.value("document.getElementById('now').textContent");
    assert!(said.as_str().unwrap().starts_with("4.0"), "{said}");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// A file of another program, byte by byte: JSON on one topic, times in reverse.
fn foreign(topic: &str, bodies: &[&[u8]]) -> Vec<u8> {
    let mut file = b"\x89MCAP0\r\n".to_vec();
    let mut record = |opcode: u8, content: &[u8]| {
        file.push(opcode);
        file.extend((content.len() as u64).to_le_bytes());
        file.extend(content);
    };
    let string = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    record(1, &[string(""), string(topic)].concat());
    let channel = [&[1, 0, 0, 0][..], &string(topic), &string("json"), &[0; 4]].concat();
    record(4, &channel);
    for (at, body) in bodies.iter().enumerate() {
        let time_ns = (10_000_000_000 - 1_000_000_000 * at as u64).to_le_bytes();
        let head = [&[1, 0][..], &(at as u32).to_le_bytes(), &time_ns, &time_ns].concat();
        record(5, &[&head, *body].concat());
    }
    record(15, &[0; 20]);
    file.extend(b"\x89MCAP0\r\n");
    file
}

#[test]
fn what_a_hostile_log_says_stays_text() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let hostile =
        "</script><script>window.hacked=1</script><img src=x onerror=window.hacked=1>\u{202e}\"'";
    let body = format!(
        "{{\"x\": 1.5, \"{}\": \"</script>\"}}",
        hostile.replace('"', "\\\"")
    );
    let bodies: [&[u8]; 4] = [
        body.as_bytes(),
        b"{\"x\": 2}",
        b"\xff\xfe</script>",
        b"{\"x\": -1e999}",
    ];
    let name = "<script>window.hacked=1<\u{2044}script>.mcap";
    std::fs::write(at.join(name), foreign(hostile, &bodies)).unwrap();
    let output = farside(at, &["view", name, "--html", "h.html"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let Some(mut browser) = opened(&at.join("h.html"), 390, "light") else {
        return;
    };
    assert_eq!(browser.value("window.hacked"), Value::Null);
    browser.value("farside.state.select(0, 3)");
    browser.wait("document.querySelector('#message pre')?.textContent.includes('</script>')");
    let lanes = browser.value("farside.sequence.lanes[0]");
    assert!(
        lanes.as_str().unwrap().starts_with("</script><script>"),
        "{lanes}"
    );
    let said = browser.value("document.getElementById('map').textContent");
    assert!(
        said.as_str().unwrap().contains("nothing to draw a map of"),
        "{said}"
    );
    assert_eq!(
        browser.value("document.images.length + document.scripts.length"),
        json!(6)
    );
    assert_eq!(browser.value("window.hacked"), Value::Null);
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn a_log_without_messages_has_a_page_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("empty.mcap"), foreign("/none", &[])).unwrap();
    assert!(farside(at, &["view", "empty.mcap"]).status.success());
    let Some(mut browser) = opened(&at.join("empty.html"), 390, "dark") else {
        return;
    };
    let said = browser.value("document.getElementById('notes').textContent");
    assert!(
        said.as_str().unwrap().contains("no message or event"),
        "{said}"
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn a_cut_log_is_shown_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "run.mcap", &[]);
    let bytes = std::fs::read(at.join("run.mcap")).unwrap();
    std::fs::write(at.join("cut.mcap"), &bytes[..bytes.len() / 2]).unwrap();
    let output = farside(at, &["view", "cut.mcap", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let notes = printed(&output)["notes"].to_string();
    assert!(notes.contains("cut at byte"), "{notes}");
}

#[test]
fn a_page_takes_the_place_of_a_page_only() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "run.mcap", &[]);
    let log = std::fs::read(at.join("run.mcap")).unwrap();
    for command in [
        &["view", "run.mcap", "--html", "run.mcap"][..],
        &["diff", "run.mcap", "run.mcap", "--html", "./run.mcap"],
    ] {
        let output = farside(at, command);
        assert_eq!(output.status.code(), Some(2), "{command:?}");
    }
    assert_eq!(std::fs::read(at.join("run.mcap")).unwrap(), log);
    std::fs::write(
        at.join("mine.html"),
        "<!DOCTYPE html><html><head><title>mine",
    )
    .unwrap();
    let output = farside(at, &["view", "run.mcap", "--html", "mine.html"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        text(&output.stderr).contains("is no page of a run"),
        "{}",
        text(&output.stderr)
    );
    let first = ["view", "run.mcap", "--html", "v.html"];
    assert!(farside(at, &first).status.success());
    let page = std::fs::read(at.join("v.html")).unwrap();
    assert!(farside(at, &first).status.success());
    assert_eq!(
        std::fs::read(at.join("v.html")).unwrap(),
        page,
        "the same log, the same page"
    );
}

/// `cargo test --release -p farside-experiments --test command -- --ignored --nocapture million`
#[test]
#[ignore = "takes half a minute; prints what it measures"]
fn a_million_messages_are_seen_at_once_and_take_less_than_20_megabytes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scenario = "system = 'traffic'\nuntil = '1000s'\n[traffic]\nhosts = ['lander']\n\
        groups = [{ prefix = 'rover', count = 20 }]\n\
        flow = [{ from = 'rover_*', to = 'lander', period = '20ms', size = '100B', stop = '1000s' }]\n\
        [links.default]\nlatency = '20ms'\njitter = '10ms'\nloss = 0.02\n";
    std::fs::write(at.join("million.toml"), scenario).unwrap();
    let output = farside(at, &["run", "million.toml", "--out", "run.mcap"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let output = farside(at, &["view", "run.mcap", "--json"]);
    let said = printed(&output);
    let megabytes = number(&said["bytes"]) / 1e6;
    assert_eq!(said["only_counted"], 0);
    assert!(megabytes < 20.0, "{megabytes} MB");
    let Some(mut browser) = opened(&at.join("run.html"), 1600, "light") else {
        return;
    };
    let paint = "performance.getEntriesByName('first-contentful-paint')[0].startTime";
    let [paint_ms, ready_ms] =
        [paint, "performance.now()"].map(|what| number(&browser.value(what)));
    let redraw = "(() => { const start = performance.now(); farside.sequence.drawNow(); return performance.now() - start; })()";
    let all_ms = number(&browser.value(redraw));
    browser.press("l");
    browser.wait("document.querySelectorAll('#chain li').length > 0");
    println!(
        "{} rows, {megabytes:.1} MB, first paint {paint_ms:.0} ms, ready {ready_ms:.0} ms, all of it drawn {all_ms:.0} ms",
        said["shown"]
    );
    assert!(paint_ms < 2_000.0);
    assert_eq!(browser.complaints, Vec::<String>::new());
}
