//! What plans and traces hold, and every mistake by its line.

mod properties;

use super::*;

fn ion(text: &str) -> ContactPlan {
    ContactPlan::from_ion(text.as_bytes()).unwrap()
}

fn ion_error(text: &str) -> String {
    ContactPlan::from_ion(text.as_bytes())
        .unwrap_err()
        .to_string()
}

fn hdtn_error(text: &str) -> String {
    ContactPlan::from_hdtn(text.as_bytes())
        .unwrap_err()
        .to_string()
}

fn window(start_s: u64, end_s: u64, rate_bit_per_s: u64, owlt_ms: u64) -> ContactWindow {
    ContactWindow {
        start: SimTime::ZERO + SimDuration::from_secs(start_s),
        end: SimTime::ZERO + SimDuration::from_secs(end_s),
        rate_bit_per_s: Some(rate_bit_per_s),
        owlt: SimDuration::from_millis(owlt_ms),
    }
}

#[test]
fn the_built_in_plans_come_to_what_their_files_say() {
    let plan = |name| {
        let file = Builtin::find(name).unwrap();
        let format = ContactFormat::guess(file.file_name, file.bytes);
        ContactPlan::from_bytes(file.bytes, format).unwrap()
    };
    let mars = plan("mars-relay");
    // The second track is parted where the light time changes.
    assert_eq!(
        mars.contact_windows("2", "1"),
        [
            window(21_600, 36_000, 512_000, 497_500),
            window(55_800, 61_200, 512_000, 497_500),
            window(61_200, 68_400, 512_000, 498_250),
        ]
    );
    assert_eq!(mars.contact_windows("3", "2").len(), 4);
    assert_eq!(mars.contact_windows("1", "3"), []);
    let unlikely: Vec<_> = mars
        .contacts()
        .filter(|c| c.confidence == Some(0.9))
        .collect();
    assert_eq!(unlikely.len(), 2);
    let summary = mars.summary();
    let down = summary.pairs.iter().find(|p| p.from == "3").unwrap();
    assert_eq!(down.volume_bytes, Some((480 + 420 + 510 + 470) * 16_000));

    let lunar = plan("lunar-relay");
    assert_eq!(
        lunar.contact_windows("21", "10"),
        [window(1800, 16_200, 512_000, 20)]
    );
    assert_eq!(
        lunar.contact_windows("1", "10")[1].owlt,
        SimDuration::from_millis(1310)
    );
}

#[test]
fn a_range_holds_for_the_way_back_unless_that_is_given() {
    let contacts = "a contact +0 +10 1 2 1\na contact +0 +10 2 1 1\n";
    let plan = ion(&format!("a range +0 +10 1 2 5\n{contacts}"));
    assert_eq!(plan.contact_windows("2", "1"), [window(0, 10, 8, 5_000)]);
    let plan = ion(&format!(
        "a range +0 +10 1 2 5\na range +4 +10 2 1 7\n{contacts}"
    ));
    let back = [window(0, 4, 8, 5_000), window(4, 10, 8, 7_000)];
    assert_eq!(plan.contact_windows("2", "1"), back);
    assert_eq!(plan.contact_windows("1", "2"), [window(0, 10, 8, 5_000)]);
    // From the greater to the lower number it holds for one way only.
    let plan = ion(&format!("a range +0 +10 2 1 5\n{contacts}"));
    let said: Vec<String> = plan.remarks().collect();
    let start = "line 2: no range covers the contact from 1 to 2 at 0s: it is passed over";
    assert!(said.len() == 1 && said[0].starts_with(start), "{said:?}");
    assert_eq!(plan.contact_windows("1", "2"), []);
    assert_eq!(plan.contact_windows("2", "1").len(), 1);
    // 10 is greater than 9, though not as text.
    assert_eq!(ion("a range +0 +1 9 10 1\na contact +0 +1 10 9 1").len(), 1);
}

#[test]
fn a_node_is_at_no_distance_from_itself_unless_a_range_says_so() {
    let plan = ion("a range +5 +9 1 1 2\na contact +0 +10 1 1 1");
    let parts = [
        window(0, 5, 8, 0),
        window(5, 9, 8, 2_000),
        window(9, 10, 8, 0),
    ];
    assert_eq!(plan.contact_windows("1", "1"), parts);
}

#[test]
fn a_range_that_goes_on_at_the_same_distance_parts_nothing() {
    let plan = ion("a range +0 +5 1 2 1\na range +5 +10 1 2 1\na contact +0 +10 1 2 1");
    assert_eq!(plan.contact_windows("1", "2"), [window(0, 10, 8, 1_000)]);
    // Where there is no range for a while, the light time stays.
    let gap = ion("a range +0 +5 1 2 1\na range +6 +10 1 2 2\na contact +0 +10 1 2 1");
    assert_eq!(
        gap.contact_windows("1", "2"),
        [window(0, 6, 8, 1_000), window(6, 10, 8, 2_000)]
    );
    let said: Vec<String> = gap.remarks().collect();
    assert_eq!(
        said,
        [
            "line 3: no range covers the contact from 1 to 2 from 5s on: its light time stays \
             as it was"
        ]
    );
}

#[test]
fn references_move_what_comes_after_them() {
    let range = "a range +0 +9999999 1 2 1\n";
    let starts = |text: &str| -> Vec<String> {
        let plan = ion(&format!("{range}{text}"));
        plan.contacts()
            .map(|contact| contact.window.start.to_string())
            .collect()
    };
    let contact = "a contact +10 +20 1 2 1\n";
    assert_eq!(
        starts(&format!("@ +100\n{contact}@ +50\n{contact}")),
        ["110s", "160s"]
    );
    let dated = "@ 2031/01/01-00:00:00\na contact 2031/01/02-00:00:00 +90000 1 2 1";
    assert_eq!(starts(dated), ["86400s"]);
    // Without a reference the earliest date counts, be it that of a range.
    let plan = ion("a range 2031/01/01-00:00:00 2032/01/01-00:00:00 1 2 1
                    a contact 2031/01/01-01:00:00 2031/01/01-02:00:00 1 2 1");
    assert_eq!(plan.start().to_string(), "3600s");
    // A range that began before the reference is cut, a contact is refused.
    let text = "@ 2031/01/01-00:00:00\na range 2030/01/01-00:00:00 +60 1 2 1\n";
    assert_eq!(ion(&format!("{text}a contact +0 +60 1 2 1")).len(), 1);
    let error = ion_error(&format!("{text}a contact 2030/12/31-23:59:58 +60 1 2 1"));
    assert!(
        error.starts_with("line 3: it begins 2 s before the reference"),
        "{error}"
    );
}

#[test]
fn what_holds_no_contact_is_skipped() {
    let text = "1 1 ''\r\ns\r\n\te 1\nv\n# a contact\nm horizon +0\n^ 2\nm alarm 'x'\n\
        a contact -1 +0 1 1 0 1.0\na contact +0 0 1 2 0\n\n   \n\
        a range +0 +60 1 2 0 # so near\na contact\t +1   +2 1\t2 5 #\n";
    assert_eq!(ion(text).contact_windows("1", "2"), [window(1, 2, 40, 0)]);
}

#[test]
fn decimals_are_exact() {
    let plan = ion("a range +0 +1 1 2 0.1\na contact +0.1 +0.3 1 2 0.125");
    let window = plan.contact_windows("1", "2")[0];
    assert_eq!(window.start.as_nanos(), 100_000_000);
    assert_eq!(window.open().as_nanos(), 200_000_000);
    assert_eq!(
        (window.rate_bit_per_s, window.owlt.as_nanos()),
        (Some(1), 100_000_000)
    );
}

/// Files, and how their errors begin.
const ION_MISTAKES: [(&str, &str); 27] = [
    (
        "\nz contact",
        "line 2, column 1: \"z\": expected a command of ionrc(5)",
    ),
    (
        "a contract +0 +1",
        "line 1, column 3: \"contract\": expected contact or range; did you mean \"contact\"?",
    ),
    ("a", "line 1: the contact or range is missing"),
    (
        "d contract * 1 2",
        "line 1, column 3: \"contract\": expected contact or range; did you mean \"contact\"?",
    ),
    (
        "c range +0 1 2 3",
        "line 1, column 3: \"range\": expected contact",
    ),
    (
        "a range +0 +9 1 2 1\na contact +0 2031/01/01-00:00:00 1 2 9",
        "line 1: times such as +0 beside dates: expected an `@` line with a date",
    ),
    (
        "a contact +0 +1 1",
        "line 1: the receiving node is missing: expected `a contact start",
    ),
    (
        "a range +0 +1 1 2",
        "line 1: the distance in light seconds is missing",
    ),
    (
        "a contact +0 +1 1 2 9 1 1",
        "line 1, column 25: \"1\" is one field too many",
    ),
    (
        "a contact 5 +1 1 2 9",
        "line 1, column 11: start time \"5\": expected +seconds or yyyy",
    ),
    (
        "a contact +-1 +1 1 2 9",
        "line 1, column 11: start time \"+-1\": expected +seconds",
    ),
    (
        "a contact +0 2031/02/30-00:00:00 1 2 9",
        "line 1, column 14: stop time \"2031/02/30-00:00:00\": expected a day that its month has",
    ),
    (
        "a contact +0 +99999999999 1 2 9",
        "line 1, column 14: stop time \"+99999999999\": expected seconds within 584 years",
    ),
    (
        "a contact +0 +1 1 2 0",
        "line 1, column 21: rate \"0\": expected from 0.125",
    ),
    (
        "a contact +0 +1 1 2 -5",
        "line 1, column 21: rate \"-5\": expected a number that is not negative",
    ),
    (
        "a contact +0 +1 1 2 0.1",
        "line 1, column 21: rate \"0.1\": expected bytes per second, a whole",
    ),
    (
        "a contact +0 +1 1 2 999999999999999",
        "line 1, column 21: rate \"999999999999999\": expected from 0.125",
    ),
    (
        "a contact +0 +1 1 2 1 1.5",
        "line 1, column 23: confidence \"1.5\": expected a number over 0",
    ),
    ("a contact +0 +1 1 2 1 inf", "line 1, column 23: confidence"),
    (
        "a contact +0 +1 -3 2 1",
        "line 1, column 17: sending node \"-3\": expected a node's number",
    ),
    (
        "a contact +0 +1 99999999999999999999 2 1",
        "line 1, column 17: sending node",
    ),
    (
        "a range +0 +9 1 2 1\na contact +5 +5 1 2 9",
        "line 2: it ends at 5s and begins at 5s",
    ),
    (
        "a range +9 +0 1 2 1\na contact +5 +6 1 2 9",
        "line 1: it ends at 0s and begins at 9s",
    ),
    (
        "a contact +5 +6 1 2 9",
        "line 1: no range covers the contact from 1 to 2 at 5s",
    ),
    (
        "a range +0 +9 1 2 1\na range +8 +10 1 2 1\na contact +5 +6 1 2 9",
        "line 2: the range from 1 to 2 overlaps that of line 1",
    ),
    (
        "a range +0 +9 1 2 1\na contact +5 +6 1 2 9\na contact +0 +9 1 2 9",
        "line 3: the contact from 1 to 2 overlaps that of line 2",
    ),
    ("", "the file holds no contact"),
];

#[test]
fn each_mistake_in_an_ion_file_has_its_line() {
    let says = |text: &str, message: &str| {
        let error = ion_error(text);
        assert!(error.starts_with(message), "{text}: {error}");
    };
    for (text, message) in ION_MISTAKES {
        says(text, message);
    }
    says(
        &" ".repeat(MAX_FILE_BYTES + 1),
        "the file has 16777217 bytes; at most 16777216",
    );
    let error = ContactPlan::from_ion(b"\n\n\xff").unwrap_err();
    assert_eq!(error, ContactError::NotText { line: 3 });
}

/// What in a good contact becomes what, and how the error begins.
const HDTN_MISTAKES: [(&str, &str, &str); 12] = [
    (
        "\"dest\": 2, ",
        "",
        "line 3: the contact has no \"dest\", the receiving node",
    ),
    (
        "startTime",
        "startTme",
        "line 3: the contact has no \"startTime\", the start in seconds; found \"startTme\" \
         instead",
    ),
    (
        "rateBitsPerSec",
        "rateBytesPerSec",
        "line 3: the contact has no \"rateBitsPerSec\", the rate in bits (not bytes) per second; \
         found \"rateBytesPerSec\"",
    ),
    (
        "rateBitsPerSec\": 8",
        "rateBitsPerSec\": -8",
        "line 3, column 77: rateBitsPerSec \"-8\": expected a number that is not negative",
    ),
    (
        "rateBitsPerSec\": 8",
        "rateBitsPerSec\": 8.5",
        "line 3, column 77: rateBitsPerSec \"8.5\": expected a number without so many",
    ),
    (
        "rateBitsPerSec\": 8",
        "rateBitsPerSec\": 1e16",
        "line 3, column 77: rateBitsPerSec \"1e16\": expected at most 1e15",
    ),
    (
        "\"owlt\": 1",
        "\"owlt\": null",
        "line 3, column 88: owlt \"null\": expected a number",
    ),
    (
        "\"owlt\": 1",
        "\"owlt\": 1, \"owlt\": 1",
        "line 3: the contact has \"owlt\" twice",
    ),
    (
        "\"startTime\": 0",
        "\"startTime\": 10",
        "line 3: it ends at 9s and begins at 10s",
    ),
    (
        "\"endTime\": 9",
        "\"endTime\": 1e99",
        "line 3, column 56: endTime \"1e99\": expected a smaller number",
    ),
    (
        "rateBitsPerSec\": 8",
        "rateBitsPerSec\": 9",
        "line 3: the contact from 1 to 2 overlaps that of line 2",
    ),
    (
        "\"source\": 1",
        "\"source\": \"a b\"",
        "line 3, column 15: source \"\\\"a b\\\"\": expected a node's number",
    ),
];

#[test]
fn each_mistake_in_an_hdtn_file_has_its_line() {
    let good = concat!(
        r#"{ "source": 1, "dest": 2, "startTime": 0, "endTime": 9, "#,
        r#""rateBitsPerSec": 8, "owlt": 1 }"#
    );
    let says = |text: &str, message: &str| {
        let error = hdtn_error(text);
        assert!(error.starts_with(message), "{text}: {error}");
    };
    let changed = |from: &str, to: &str| {
        let contact = good.replace(from, to);
        format!("{{ \"contacts\": [\n{good},\n  {contact} ] }}")
    };
    for (from, to, message) in HDTN_MISTAKES {
        says(&changed(from, to), message);
    }
    says(
        "{ \"contacts\": [\n\n[] ] }",
        "line 3, column 1: not an HDTN contact plan: invalid type: sequence, expected a contact",
    );
    says(
        "{ \"contacts\": 5 }",
        "line 1, column 15: not an HDTN contact plan: invalid type: integer `5`, expected an \
         array of contacts",
    );
    says(
        "{ \"contact\": [] }",
        "line 1, column 17: not an HDTN contact plan: missing field `contacts`",
    );
    says("{ \"contacts\": [] }", "the file holds no contact");
    let whole = changed("\"source\": 1", "\"source\": 3");
    assert!(ContactPlan::from_hdtn(whole.as_bytes()).is_ok());
    for cut in 0..whole.len() {
        says(&whole[..cut], "line ");
    }
    assert!(hdtn_error(&"[".repeat(1_000_000)).starts_with("line 1"));
    let deep = format!("{{\"contacts\":[{}", "[".repeat(1_000_000));
    assert!(hdtn_error(&deep).starts_with("line 1"));
}

#[test]
fn hdtn_takes_what_hdtn_takes() {
    let text = r#"{ "version": [1], "contacts": [
        { "contact": 3, "finalDestination": {"a": [2]}, "source": "102", "dest": 010e0,
          "startTime": "0", "endTime": 2000, "rate": 100, "owlt": 1 } ] }"#;
    let error = hdtn_error(text);
    assert!(
        error.starts_with("line 2"),
        "JSON has no leading zeros: {error}"
    );
    let plan = ContactPlan::from_hdtn(text.replace("010e0", "10").as_bytes()).unwrap();
    assert_eq!(
        plan.contact_windows("102", "10"),
        [window(0, 2000, 100_000_000, 1_000)]
    );
    assert_eq!(plan.contacts().next().unwrap().line, 2);
}

#[test]
fn every_fault_of_a_file_is_told_up_to_twenty() {
    let text = "a contact +x +y 1 2 -1\na range +0 +9 1 2 1\na contact +5 +4 1 2 9\nz\n\
        a contact +0 +9 1 2 9\na contact +3 +6 1 2 9";
    let error = ContactPlan::from_ion(text.as_bytes()).unwrap_err();
    let lines: Vec<_> = error.faults().iter().map(|f| f.line().unwrap()).collect();
    assert_eq!(lines, [1, 1, 1, 3, 4, 6], "{error}");
    assert_eq!(error.to_string().lines().count(), 6);
    let many = ion_error(&"a contact\n".repeat(123));
    assert_eq!(many.lines().count(), 1 + MAX_FAULTS);
    assert!(many.ends_with("\nand 103 more"), "{many}");
    let contact =
        r#"{"source": -1, "dest": "a b", "startTime": 0, "endTime": 9, "rateBitsPerSec": 8}"#;
    let json = format!("{{\"contacts\": [{contact},\n5,\n{contact}]}}");
    let error = ContactPlan::from_hdtn(json.as_bytes()).unwrap_err();
    let lines: Vec<_> = error.faults().iter().map(|f| f.line().unwrap()).collect();
    assert_eq!(lines, [1, 1, 2, 3, 3], "{error}");
}

#[test]
fn contacts_and_ranges_are_changed_and_deleted() {
    let text = "a range +0 +60 1 2 1\na range +60 +99 1 2 5\na contact +0 +20 1 2 10\n\
        a contact +20 +40 1 2 10\na contact +40 +60 1 2 10\na contact +0 +60 2 1 10\n\
        a contact +60 +70 2 1 10\n";
    let plan = ion(&format!(
        "{text}c contact +0 1 2 20\nc contact +20 1 2 20 0.5\nd contact +40 1 2\nd contact * 2 1\n\
         d range +60 1 2\nd contact 0 1 2\nd contact -1 1 1\n"
    ));
    let windows = [window(0, 20, 160, 1_000), window(20, 40, 160, 1_000)];
    assert_eq!(plan.contact_windows("1", "2"), windows);
    assert_eq!(plan.contact_windows("2", "1"), []);
    assert_eq!(plan.contacts().nth(1).unwrap().confidence, Some(0.5));
    let said: Vec<String> = ion(&format!("{text}d contact +1 1 2")).remarks().collect();
    assert_eq!(
        said,
        ["line 8: there is no such contact: the command is passed over"]
    );
}

#[test]
fn only_the_part_for_ionadmin_is_read() {
    let part = |node: u32| format!("a range +0 +9 {node} 9 1\na contact +0 +9 {node} 9 1\n");
    let (one, two, three) = (part(1), part(2), part(3));
    let text = format!(
        "{three}## begin bpadmin\na scheme ipn 'ipnfw' 'ipnadminep'\n## end bpadmin\n\
         ## begin ionadmin tag\n{one}## end ionadmin tag\n{three}##  begin ionadmin\r\n{two}"
    );
    let plan = ion(&text);
    let pairs: Vec<_> = plan.pairs().map(|(from, ..)| from).collect();
    assert_eq!(pairs, ["1", "2"]);
    // What only looks like it is a comment.
    assert_eq!(ion(&format!("## beginning\n# begin x\n{one}")).len(), 1);
    let none = ion_error("## begin bpadmin\na contact +0 +9 1 2 3\n## end bpadmin");
    assert!(none.starts_with("the file holds no contact"), "{none}");
}

#[test]
fn too_many_contacts_are_refused_in_good_time() {
    let text = "a contact +0 +1 1 2 1\n".repeat(MAX_CONTACTS + 1);
    assert!(ion_error(&text).starts_with("line 200001: more than 200000 contacts"));
    let json = format!("{{\"contacts\":[{}0]}}", "0,".repeat(MAX_CONTACTS));
    assert!(hdtn_error(&json).contains("more than 200000 contacts"));
    // All on one line: columns are counted for errors only.
    let each = |n: usize| {
        format!(
            "{{\"source\":1,\"dest\":2,\"startTime\":{n},\"endTime\":{},\"rate\":1,\"owlt\":1}}",
            n + 1
        )
    };
    let all: Vec<String> = (0..100_000).map(each).collect();
    let plan = ContactPlan::from_hdtn(format!("{{\"contacts\":[{}]}}", all.join(",")).as_bytes());
    assert_eq!(plan.unwrap().len(), 100_000);
}

#[test]
fn each_mistake_in_a_trace_has_its_line() {
    let says = |text: &str, message: &str| {
        let error = CapacityTrace::from_mahimahi(text.as_bytes())
            .unwrap_err()
            .to_string();
        assert!(error.starts_with(message), "{text}: {error}");
    };
    says("", "the file holds no stamp");
    says("\n\n", "the file holds no stamp");
    says("0\n0\n", "line 2: the last stamp is 0 ms");
    says(
        "1\n\n2",
        "line 2: stamp \"\": expected a whole number of milliseconds",
    );
    says("1\n-2", "line 2: stamp \"-2\": expected a whole number");
    says("1\n2.5", "line 2: stamp \"2.5\": expected a whole number");
    says("1 2", "line 1: stamp \"1 2\": expected a whole number");
    says("5\n4", "line 2: 4 ms after 5 ms");
    says(
        "99999999999999999999999",
        "line 1: stamp \"99999999999999999999999\": expected milliseconds within a year",
    );
    let file = Builtin::find_trace("rover-radio").unwrap();
    let trace = CapacityTrace::from_mahimahi(file.bytes).unwrap();
    assert_eq!(trace.opportunities_ns().len(), 40);
}
