//! Files of other programs whose schemas and messages are made to do harm: every command that reads them answers
//! or says what is wrong, in little memory.

use std::path::Path;
use std::process::Command;

use crate::common::{skip, text};

/// As much address space as a command may have [KiB].
const MOST_KIB: u32 = 1_500_000;

/// The commands, with such a file.
const COMMANDS: [&[&str]; 14] = [
    &["info", "x.mcap", "--topics"],
    &["info", "x.mcap", "--json"],
    &["cat", "x.mcap"],
    &["cat", "x.mcap", "--csv"],
    &["plot", "x.mcap", "/x.a", "--out", "x.svg"],
    &["diff", "x.mcap", "y.mcap"],
    &["diff", "y.mcap", "x.mcap", "--ignore", "a.b", "--json"],
    &["diff", "x.mcap", "y.mcap", "--tolerance", "a=1e-9"],
    &["draw", "x.mcap", "--sequence", "mermaid", "--out", "x.mmd"],
    &["draw", "x.mcap", "--list"],
    &["verify", "x.mcap"],
    &["why", "x.mcap", "a"],
    &["ties", "x.mcap", "--seeds", "1"],
    &["recover", "x.mcap", "--out", "fixed.mcap"],
];

fn string(text: &[u8]) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text].concat()
}

fn record(opcode: u8, content: &[u8]) -> Vec<u8> {
    [
        &[opcode],
        &(content.len() as u64).to_le_bytes()[..],
        content,
    ]
    .concat()
}

/// A file of one channel with these messages.
fn file(schema: &Hostile, bodies: &[&[u8]]) -> Vec<u8> {
    let magic = b"\x89MCAP0\r\n";
    let header = [string(b""), string(b"x")].concat();
    let written = [
        &1u16.to_le_bytes()[..],
        &string(b"pkg/msg/R"),
        &string(schema.written.as_bytes()),
        &string(&schema.text),
    ];
    let channel = [
        &1u16.to_le_bytes()[..],
        &1u16.to_le_bytes(),
        &string(b"/x"),
        &string(schema.encoding.as_bytes()),
        &0u32.to_le_bytes(),
    ];
    let mut out = magic.to_vec();
    out.extend(record(1, &header));
    out.extend(record(3, &written.concat()));
    out.extend(record(4, &channel.concat()));
    for (at, body) in bodies.iter().enumerate() {
        let time = at as u64 + 1;
        let head = [
            &1u16.to_le_bytes()[..],
            &(at as u32).to_le_bytes(),
            &time.to_le_bytes(),
            &time.to_le_bytes(),
            body,
        ];
        out.extend(record(5, &head.concat()));
    }
    out.extend(record(0x0f, &[0; 4]));
    out.extend(record(2, &[0; 20]));
    out.extend(magic);
    out
}

/// A schema with a message, made to do harm.
struct Hostile {
    name: &'static str,
    written: &'static str,
    encoding: &'static str,
    text: Vec<u8>,
    body: Vec<u8>,
}

fn hostile(
    name: &'static str,
    (written, encoding): (&'static str, &'static str),
    text: impl Into<Vec<u8>>,
    body: impl Into<Vec<u8>>,
) -> Hostile {
    let (text, body) = (text.into(), body.into());
    Hostile {
        name,
        written,
        encoding,
        text,
        body,
    }
}

/// What CDR begins with.
const LITTLE: [u8; 4] = [0, 1, 0, 0];

fn cdr(body: &[u8]) -> Vec<u8> {
    [&LITTLE, body].concat()
}

fn ros() -> Vec<Hostile> {
    let two = ("ros2msg", "cdr");
    let one = ("ros1msg", "ros1");
    let idl = ("ros2idl", "cdr");
    let bar = "=".repeat(80);
    let circle = format!("A a\n{bar}\nMSG: pkg/A\nB b\n{bar}\nMSG: pkg/B\nA a\n");
    let many = format!(
        "A[100000] a\n{bar}\nMSG: pkg/A\nB[100000] b\n{bar}\nMSG: pkg/B\nC[100000] c\n{bar}\nMSG: pkg/C\nuint8 d\n"
    );
    let nothing = format!("E[4000000000] a\n{bar}\nMSG: pkg/E\n");
    let deep: String = (0..2000)
        .map(|at| format!("T{} t\n{bar}\nMSG: pkg/T{}\n", at + 1, at + 1))
        .collect();
    let huge = [0xff; 64];
    let mut all = Vec::new();
    for kind in [two, one] {
        let body = |bytes: &[u8]| match kind.1 {
            "cdr" => cdr(bytes),
            _ => bytes.to_vec(),
        };
        all.push(hostile("refers to itself", kind, "R r\n", body(&huge)));
        all.push(hostile(
            "a circle of types",
            kind,
            circle.as_str(),
            body(&huge),
        ));
        all.push(hostile(
            "a circle of lists",
            kind,
            circle.replace("A a", "A[] a"),
            body(&huge),
        ));
        all.push(hostile(
            "an array of 4 billion",
            kind,
            "uint8[4294967295] a\n",
            body(&huge),
        ));
        all.push(hostile(
            "an array of 2^64",
            kind,
            "float64[18446744073709551615] a\n",
            body(&huge),
        ));
        all.push(hostile(
            "arrays of arrays of arrays",
            kind,
            many.as_str(),
            body(&huge),
        ));
        all.push(hostile(
            "4 billion of nothing",
            kind,
            nothing.as_str(),
            body(&huge),
        ));
        let list = nothing.replace("[4000000000]", "[]");
        all.push(hostile(
            "a list of 4 billion of nothing",
            kind,
            list,
            body(&huge),
        ));
        all.push(hostile(
            "types in types, very deep",
            kind,
            deep.as_str(),
            body(&huge),
        ));
        all.push(hostile(
            "a text longer than the message",
            kind,
            "string a\n",
            body(&huge),
        ));
        all.push(hostile(
            "a list longer than the message",
            kind,
            "float64[] a\n",
            body(&huge),
        ));
        all.push(hostile("no message", kind, "float64[] a\nstring b\n", []));
        all.push(hostile(
            "no UTF-8",
            kind,
            [0xff, 0xfe, b' ', b'a'],
            body(&huge),
        ));
        all.push(hostile("no type", kind, "[3] a\n= = =\n", body(&huge)));
    }
    let sequences = format!(
        "struct R {{ {}long{} a; }};",
        "sequence<".repeat(500),
        ">".repeat(500)
    );
    let dims = "module pkg { module msg { struct R { double a[65536][65536][65536]; }; }; };";
    let own = "module pkg { module msg { struct R { sequence<R> a; R b; }; }; };";
    let wide = "module pkg { module msg { struct R { wstring a; }; }; };";
    all.push(hostile("sequences, very deep", idl, sequences, cdr(&huge)));
    all.push(hostile("an array of 2^48", idl, dims, cdr(&huge)));
    all.push(hostile("a struct of itself", idl, own, cdr(&huge)));
    all.push(hostile(
        "a wide text longer than the message",
        idl,
        wide,
        cdr(&huge),
    ));
    all.push(hostile(
        "a union without an end",
        idl,
        "union U switch (long)",
        cdr(&huge),
    ));
    all.push(hostile(
        "a comment without an end",
        idl,
        "/* struct R {",
        cdr(&huge),
    ));
    all
}

/// A field of protobuf with a length.
fn part(number: u8, bytes: &[u8]) -> Vec<u8> {
    let mut out = vec![number << 3 | 2];
    let mut length = bytes.len();
    while length > 0x7f {
        out.push(length as u8 | 0x80);
        length >>= 7;
    }
    out.push(length as u8);
    out.extend(bytes);
    out
}

fn others() -> Vec<Hostile> {
    let proto = ("protobuf", "protobuf");
    let flat = ("flatbuffer", "flatbuffer");
    let json = ("jsonschema", "json");
    // message R { R a = 1; }
    let field = [
        part(1, b"a"),
        vec![0x18, 1, 0x20, 1, 0x28, 11],
        part(6, b".pkg.msg.R"),
    ]
    .concat();
    let message = [part(1, b"R"), part(2, &field)].concat();
    let of_itself = part(
        1,
        &[part(1, b"r.proto"), part(2, b"pkg.msg"), part(4, &message)].concat(),
    );
    let mut nested = Vec::new();
    for _ in 0..5000 {
        nested = part(1, &nested);
    }
    let cut = &of_itself[..of_itself.len() / 2];
    let long = [
        0x0a, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f, 1,
    ];
    let outside = [&0x7fff_fff0u32.to_le_bytes()[..], b"BFBS", &[0xff; 60]].concat();
    let round = [&4u32.to_le_bytes()[..], b"BFBS", &[0; 60]].concat();
    vec![
        hostile("nested, very deep", proto, of_itself.as_slice(), nested),
        hostile("a length of 2^63", proto, of_itself.as_slice(), long),
        hostile("half a schema", proto, cut, long),
        hostile("a schema of a length of 2^63", proto, long, [1, 2, 3]),
        hostile(
            "offsets outside of the schema",
            flat,
            outside.as_slice(),
            [0xff; 40],
        ),
        hostile("offsets to themselves", flat, round, [0; 40]),
        hostile("an empty schema", flat, [], outside),
        hostile("lists, very deep", json, "{}", "[".repeat(200_000)),
        hostile(
            "a number with very many digits",
            json,
            "{}",
            format!("{{\"a\":{}}}", "9".repeat(200_000)),
        ),
        hostile(
            "a number that is very large",
            json,
            "{}",
            "{\"a\":1e999999999}",
        ),
        hostile("no JSON", json, "{", [0xff, 0x00, b'{']),
        hostile(
            "a schema that nobody reads",
            ("xyz", "xyz"),
            [0xff; 9],
            [0xff; 9],
        ),
        hostile(
            "a schema of another encoding",
            ("ros2msg", "json"),
            "R r\n",
            "{\"a\":1}",
        ),
    ]
}

fn run(folder: &Path, command: &[&str], what: &str) {
    let script = format!("ulimit -v {MOST_KIB} && exec \"$0\" \"$@\"");
    let output = Command::new("sh")
        .args(["-c", &script, env!("CARGO_BIN_EXE_farside")])
        .args(command)
        .current_dir(folder)
        .output()
        .expect("there is a shell");
    let stderr = String::from_utf8_lossy(&output.stderr);
    let code = output.status.code();
    assert!(
        code.is_some_and(|code| code < 3),
        "{what}: {command:?}: {code:?}: {stderr}"
    );
    assert!(
        !stderr.contains("panicked"),
        "{what}: {command:?}: {stderr}"
    );
    // Whoever refuses says why, in few words.
    assert!(
        code != Some(2) || stderr.contains("error: "),
        "{what}: {command:?}"
    );
    let said = output.stdout.len() + output.stderr.len();
    assert!(said < 1_000_000, "{what}: {command:?}: {said} bytes");
    if command.contains(&"--json") && code != Some(2) {
        let read: Result<serde_json::Value, _> = serde_json::from_slice(&output.stdout);
        assert!(
            read.is_ok(),
            "{what}: {command:?}: {}",
            text(&output.stdout)
        );
    }
}

#[test]
fn hostile_schemas_get_an_answer_or_an_error_from_every_command() {
    if !cfg!(target_os = "linux") {
        return skip("hostile schemas", "memory is limited by a Linux shell");
    }
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    for one in ros().iter().chain(&others()) {
        write(
            "x.mcap",
            &file(one, &[&one.body, &one.body[..one.body.len() / 2]]),
        );
        write(
            "y.mcap",
            &file(one, &[&one.body[..one.body.len() / 2], &one.body]),
        );
        let what = format!("{} ({})", one.name, one.written);
        for command in COMMANDS {
            run(folder.path(), command, &what);
        }
    }
}
