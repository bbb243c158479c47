//! What is read of IDL, and what is refused.

use super::*;
use crate::decode::cdr;

fn shown(name: &str, text: &str) -> String {
    let structs = match read(name, text) {
        Ok(structs) => structs,
        Err(error) => return error.to_string(),
    };
    let fields = structs.structs[structs.root].fields.iter();
    let fields = fields.map(|field| format!("{} {}", field.kind.says(&structs), field.name));
    fields.collect::<Vec<_>>().join(", ")
}

const TEXT: &str = r#"
================================================================================
IDL: pkg/msg/Inner
// generated from rosidl
#include "other.idl"
module pkg { module msg {
  module Inner_Constants { const int32 MOST = 3; @verbatim (language="comment", text="a (b)" "c")
    const string<5> NAME = "it's"; };
  struct Inner { @default (value=1.5) double x; };
  enum Colour { RED, @value(4) GREEN, BLUE };
}; };
================================================================================
IDL: pkg/msg/Root
module pkg {
  module msg {
    typedef double double__3[3];
    typedef sequence<Inner, 2> Few;
    @verbatim (language="comment", text=
      "a comment;" "}")
    struct Root {
      unsigned long long id; long a, b[2][4];
      double__3 covariance;
      Few few;
      sequence<pkg::msg::Inner> many;
      string<10> name; wstring wide;
      pkg::msg::Colour colour;
      sequence<octet, Inner_Constants::MOST> bytes;
      ::pkg::msg::Inner last;
    };
  };
};
"#;

#[test]
fn types_are_found_by_their_scope() {
    let expected = "u64 id, i32 a, i32[4][2] b, f64[3] covariance, pkg/msg/Inner[<=2] few, \
        pkg/msg/Inner[] many, string<=10 name, wstring wide, pkg/msg/Colour colour, u8[<=3] bytes, \
        pkg/msg/Inner last";
    assert_eq!(shown("pkg/msg/Root", TEXT), expected);
}

#[test]
fn what_is_not_read_is_refused_with_its_line() {
    for (text, word) in [
        (
            "struct R { long x; ",
            "line 1 of the schema: expected a type",
        ),
        ("struct R {\n long 5; };", "line 2"),
        ("struct R { lonk x; };", "\"lonk\" is not declared"),
        ("struct R { long x[-1]; };", "no length"),
        ("struct R { long x[N]; };", "no number"),
        ("struct R { long double x; };", "long double"),
        ("struct R { map<long, long> x; };", "map is not read"),
        ("/* struct R {}; ", "comment that does not end"),
        (
            "struct S { long x; };",
            "no struct \"R\"; did you mean \"S\"?",
        ),
        ("@value(x) struct R { long x; };", "integer"),
        ("const string S = \"a", "text that does not end"),
        ("union U switch (long)", "union that does not end"),
        ("struct R { long x; }", ""),
    ] {
        let told = shown("R", text);
        assert!(told.contains(word), "{text}: {told}");
    }
    let deep = format!(
        "struct R {{ {}long{} x; }};",
        "sequence<".repeat(99),
        ">".repeat(99)
    );
    assert!(shown("R", &deep).contains("too deep"));
    let deep = format!("{}{}", "module m {".repeat(99), "};".repeat(99));
    assert!(shown("R", &deep).contains("too deep"));
}

#[test]
fn types_that_are_kept_are_refused_where_a_message_holds_one() {
    for (text, word) in [
        ("@mutable struct R { long x; };", "mutable"),
        ("@extensibility(MUTABLE) struct R { long x; };", "mutable"),
        ("struct R { @optional long x; };", "optional"),
        (
            "union U switch (long) { case 1: long x; }; struct R { U u; };",
            "union",
        ),
        (
            "struct B { long x; }; struct R : B { long y; };",
            "goes on from",
        ),
    ] {
        let structs = read("R", text).unwrap();
        let error = cdr::cdr(&structs, &[0, 1, 0, 0, 1, 0, 0, 0]).unwrap_err();
        assert!(error.to_string().contains(word), "{text}: {error}");
    }
}

#[test]
fn enumerations_have_names() {
    let text = "enum E { A, @value(4) B, C }; struct R { E a; E b; E c; };";
    let structs = read("R", text).unwrap();
    let data = [0, 1, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 9, 0, 0, 0];
    let value = cdr::cdr(&structs, &data).unwrap();
    assert_eq!(value.to_string(), r#"{"a":"A","b":"C","c":9}"#);
}

#[test]
fn typedefs_of_typedefs_do_not_grow_without_bound() {
    let mut text = "typedef sequence<long> T0;".to_owned();
    for at in 0..100 {
        text.push_str(&format!("typedef sequence<T{at}> T{};", at + 1));
    }
    assert!(shown("R", &text).contains("too deep"));
}
