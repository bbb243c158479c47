//! Values come back equal, others can read the bytes, and hostile bytes do no harm.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;

use proptest::collection::{btree_map, vec};
use proptest::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{DecodeError, EncodeError, Schema, SchemaError};

mod foreign;
mod properties;
mod types;

use types::*;

fn schema<T: Serialize + DeserializeOwned + 'static>() -> Schema {
    Schema::of::<T>().unwrap_or_else(|error| panic!("{error}"))
}

fn encode<T: Serialize>(schema: &Schema, value: &T) -> Vec<u8> {
    let mut bytes = Vec::new();
    schema.encode(value, &mut bytes).unwrap();
    bytes
}

/// Encodes, decodes, compares, and checks that the descriptor explains the bytes in full.
fn check<T: Serialize + DeserializeOwned + PartialEq + Debug + 'static>(value: T) {
    let schema = schema::<T>();
    let bytes = encode(&schema, &value);
    assert_eq!(schema.decode::<T>(&bytes).unwrap(), value);
    let message = foreign::dynamic(&schema, &bytes);
    assert_eq!(message.unknown_fields().count(), 0, "{message:?}");
}

#[test]
fn roots_of_every_form_come_back() {
    check(Unit);
    check(Meters(2.5));
    check(Rows(vec![vec![1, 2], vec![], vec![300]]));
    check(Corner(1, -2, "x".into()));
    check(Mode::Drive);
    check(Order::Stop);
    check(Order::Speed(-0.0));
    check(Order::Via(vec![(1, 2), (3, 4)]));
    check(Order::Pair(7, Mode::Idle));
    check(Order::Goto {
        x: 1.0,
        note: Some("n".into()),
    });
    check(Order::Again(Box::new(Order::Maybe(None))));
}

#[test]
fn recursive_types_come_back() {
    check(Tree(vec![Tree(vec![]), Tree(vec![Tree(vec![])])]));
    check(List {
        value: 1,
        next: Some(Box::new(List {
            value: 2,
            next: None,
        })),
    });
    check(Expr::Add(
        Box::new(Expr::Num(1.0)),
        Box::new(Expr::Neg(Box::new(Expr::Num(2.0)))),
    ));
    check(Holder {
        trees: Wrapped(Tree(vec![Tree(vec![])])),
        pair: Some(Box::new((1, None))),
    });
}

#[test]
fn helpers_stand_where_protobuf_has_no_form() {
    check(Nested {
        twice: Some(None),
        thrice: Some(Some(None)),
        rows: vec![vec![], vec![1.0]],
        gaps: vec![None, Some(3)],
        list: Some(vec![]),
        lists: BTreeMap::from([("a".into(), vec![1]), ("b".into(), vec![])]),
        odd: BTreeMap::from([((-1, true), None), ((1, false), Some(Mode::Drive))]),
        modes: vec![Some(Mode::Drive), None],
        set: BTreeSet::from([3, 1]),
        units: vec![(), ()],
        empty: [],
        chars: [['a', 'é'], ['漢', '\0']],
        map_of_maps: Some(BTreeMap::from([(1, BTreeMap::from([(true, 'x')]))])),
    });
}

#[test]
fn serde_attributes_are_followed() {
    check(Attributes {
        kebab_name: 1,
        kind: 2,
        shown: None,
        seven: 7,
        aliased: 5,
    });
    check(Attributes {
        kebab_name: 0,
        kind: 0,
        shown: Some(0),
        seven: 0,
        aliased: 0,
    });
    check(SkippedVariant::C);
    assert_eq!(schema::<Renamed>().name(), "Wanted");
    assert_eq!(schema::<Transparent>().name(), "Meters");
    check(Transparent { inner: Meters(1.0) });
    check(Bounded {
        low: Low(1),
        count: std::num::NonZeroU32::new(5).unwrap(),
    });
}

mod left_out {
    //! Types whose fields would not come back, and their like that do.

    use serde::{Deserialize, Serialize};
    use std::collections::BTreeMap;

    pub(super) fn seven() -> u32 {
        7
    }

    fn is_seven(value: &u32) -> bool {
        *value == 7
    }

    fn some_seven() -> Option<u32> {
        Some(7)
    }

    fn is_some_seven(value: &Option<u32>) -> bool {
        *value == some_seven()
    }

    fn ones() -> Vec<u32> {
        vec![1]
    }

    fn are_ones(values: &[u32]) -> bool {
        values == ones()
    }

    fn is_zero(value: &u32) -> bool {
        *value == 0
    }

    macro_rules! types {
        ($($name:ident { $($(#[$of:meta])* $field:ident: $ty:ty),* })*) => {$(
            #[derive(Serialize, Deserialize, PartialEq, Debug)]
            pub(super) struct $name { $($(#[$of])* pub(super) $field: $ty),* }
        )*};
    }

    types! {
        Skip { kept: u32, #[serde(skip)] gone: u32 }
        SkipWithDefault { kept: u32, #[serde(skip, default = "seven")] gone: u32 }
        SkipText { kept: Vec<u8>, #[serde(skip)] gone: String }
        SkipSerializing { kept: u32, #[serde(skip_serializing, default)] gone: u32 }
        SkipSerializingOption { #[serde(skip_serializing)] gone: Option<u32>, kept: u32 }
        SkipSome { #[serde(skip_serializing_if = "Option::is_some")] gone: Option<u32>, kept: u32 }
        SkipOfNoDefault { #[serde(skip_serializing_if = "is_seven")] gone: u32 }
        SkipOfOtherDefault { #[serde(default, skip_serializing_if = "is_seven")] gone: u32 }
        SkipOfSome {
            #[serde(default = "some_seven", skip_serializing_if = "is_some_seven")]
            gone: Option<u32>
        }
        SkipOfList { #[serde(default = "ones", skip_serializing_if = "are_ones")] gone: Vec<u32> }
        Inside { kept: u32, inner: Vec<SkipOfList> }
        InMap { inner: BTreeMap<u32, Option<SkipSome>> }
        Good {
            #[serde(default = "seven", skip_serializing_if = "is_seven")] seven: u32,
            #[serde(default, skip_serializing_if = "is_zero")] zero: u32,
            #[serde(skip_serializing_if = "Option::is_none")] none: Option<u32>,
            #[serde(default, skip_serializing_if = "Vec::is_empty")] empty: Vec<u32>,
            #[serde(default)] nothing: bool,
            #[serde(default = "ones")] ones: Vec<u32>,
            #[serde(default = "some_seven")] some: Option<u32>,
            #[serde(skip)] marker: std::marker::PhantomData<u64>,
            wide: u128, narrow: u8, middle: u16
        }
    }

    #[derive(Serialize, Deserialize)]
    pub(super) struct Pair(
        u64,
        #[serde(skip)]
        #[expect(dead_code)]
        u64,
    );

    #[derive(Serialize, Deserialize)]
    #[repr(C)]
    pub(super) struct AsInC {
        a: u8,
        b: u64,
        c: u8,
    }

    #[derive(Serialize, Deserialize)]
    #[repr(align(64))]
    pub(super) struct Aligned {
        a: u8,
    }

    #[derive(Serialize, Deserialize)]
    pub(super) struct Tree {
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        children: Vec<Tree>,
    }

    #[derive(Serialize, Deserialize)]
    pub(super) enum Variants {
        One {
            kept: u32,
        },
        Two {
            #[serde(skip_serializing, default)]
            gone: u32,
        },
    }
}

#[test]
fn fields_that_would_not_come_back_are_refused_by_name() {
    use left_out::*;
    fn refused<T: Serialize + DeserializeOwned + 'static>(said: &str) {
        let error = Schema::of::<T>().expect_err(said).to_string();
        let name = std::any::type_name::<T>();
        assert!(error.contains(said) && error.contains(name), "{error}");
    }
    refused::<Skip>("#[serde(skip)]");
    refused::<SkipWithDefault>("#[serde(skip)]");
    refused::<SkipText>("#[serde(skip)]");
    refused::<Pair>("#[serde(skip)]");
    refused::<SkipSerializing>("`SkipSerializing.gone`");
    refused::<SkipSerializingOption>("`SkipSerializingOption.gone`");
    refused::<SkipSome>("`SkipSome.gone`");
    refused::<SkipOfNoDefault>("`SkipOfNoDefault.gone`");
    refused::<SkipOfOtherDefault>("`SkipOfOtherDefault.gone`");
    refused::<SkipOfSome>("`SkipOfSome.gone`");
    refused::<SkipOfList>("`SkipOfList.gone`");
    refused::<Inside>("`SkipOfList.gone`");
    refused::<InMap>("`SkipSome.gone`");
    refused::<Variants>("gone`");
}

#[test]
fn fields_that_come_back_may_be_left_out() {
    use left_out::*;
    let good = |seven, zero, none, empty: Vec<u32>, some| Good {
        seven,
        zero,
        none,
        empty,
        nothing: false,
        ones: vec![],
        some,
        marker: std::marker::PhantomData,
        wide: 0,
        narrow: 1,
        middle: 2,
    };
    check(good(7, 0, None, vec![], None));
    check(good(0, 7, Some(7), vec![1], Some(7)));
    check(good(seven(), 1, Some(0), vec![0], Some(0)));
    schema::<AsInC>();
    schema::<Aligned>();
    schema::<Tree>();
}

#[test]
fn types_of_one_name_stay_apart() {
    check(Twins {
        number: Wrapper { inner: 1 },
        text: Wrapper { inner: "t".into() },
        here: Point { x: 1 },
        there: other::Point { y: vec![2.0] },
    });
}

#[test]
fn every_nan_is_written_as_one_nan() {
    let schema = schema::<Meters>();
    let odd = f64::from_bits(0xfff8_dead_beef_0001);
    assert_eq!(
        encode(&schema, &Meters(odd)),
        encode(&schema, &Meters(f64::NAN))
    );
    assert_eq!(
        encode(&schema, &Meters(odd))[1..],
        0x7ff8_0000_0000_0000_u64.to_le_bytes()
    );
}

#[test]
fn long_contents_widen_their_lengths() {
    for len in [0, 1, 126, 127, 128, 129, 16_383, 16_384, 70_000] {
        check(Blob {
            before: 1,
            text: "x".repeat(len),
            after: 2,
        });
        check(Outer {
            blob: Blob {
                before: 1,
                text: "x".repeat(len),
                after: 2,
            },
            tail: 3,
        });
        check(Rows(vec![vec![1; len], vec![u64::MAX; 2]]));
        check(Reals {
            values: vec![0.5; len],
        });
    }
}

#[test]
fn maps_are_sorted_by_encoded_key_whatever_the_order_of_writing() {
    let schema = schema::<Counts>();
    let forward = Counts {
        by_name: Pairs(vec![(1, 1), (2, 2), (300, 3)]),
    };
    let backward = Counts {
        by_name: Pairs(vec![(300, 3), (2, 2), (1, 1)]),
    };
    assert_eq!(encode(&schema, &forward), encode(&schema, &backward));
}

fn refused<T: Serialize + DeserializeOwned + Debug + 'static>(parts: &[&str]) {
    let error = Schema::of::<T>()
        .expect_err(std::any::type_name::<T>())
        .to_string();
    for part in parts {
        assert!(error.contains(part), "no `{part}` in: {error}");
    }
}

#[test]
fn what_has_no_shape_is_refused_by_name() {
    refused::<u32>(&["u32", "wrap it"]);
    refused::<Vec<String>>(&["Vec", "sequence"]);
    refused::<HasFlatten>(&["HasFlatten", "flatten"]);
    refused::<HasUntagged>(&["HasUntagged.either", "untagged"]);
    refused::<HasInternal>(&["Internal", "internally tagged"]);
    refused::<HasAdjacent>(&["Adjacent", "adjacently tagged"]);
    refused::<HasHashMap>(&["HashMap", "BTreeMap"]);
    refused::<HasHashSet>(&["HashSet", "BTreeSet"]);
    refused::<Endless>(&["Endless"]);
    refused::<Picky>(&["Picky", "never good enough"]);
    refused::<NoVariant>(&["NoVariant", "without variants"]);
    refused::<AllSkipped>(&["AllSkipped", "without variants"]);
    refused::<HasNoVariant>(&["NoVariant", "HasNoVariant.rest", "without variants"]);
    refused::<Asymmetric>(&["Asymmetric", "`a`"]);
}

#[test]
fn values_may_nest_only_as_deep_as_readers_accept() {
    let deep = |levels: u32| {
        (0..levels).fold(
            List {
                value: 0,
                next: None,
            },
            |list, value| List {
                value,
                next: Some(Box::new(list)),
            },
        )
    };
    check(deep(95));
    let error = schema::<List>()
        .encode(&deep(96), &mut Vec::new())
        .unwrap_err();
    assert_eq!(error, EncodeError::TooDeep { limit: 96 });
    // One that a writer without limit made.
    let mut bytes = vec![];
    for _ in 0..200 {
        let mut outer = vec![0x12];
        super::wire::put_varint(&mut outer, super::wire::Tag::NONE, bytes.len() as u64);
        outer.append(&mut bytes);
        bytes = outer;
    }
    let error = schema::<List>().decode::<List>(&bytes).unwrap_err();
    assert_eq!(error, DecodeError::TooDeep { limit: 96 });
}

#[test]
fn a_failed_encoding_leaves_the_buffer_as_it_was() {
    /// Begins as a `Blob` does.
    #[derive(Serialize)]
    struct NoBlob {
        before: u32,
        text: u32,
    }
    let schema = schema::<Blob>();
    let mut bytes = vec![1, 2, 3];
    let error = schema
        .encode(&NoBlob { before: 1, text: 2 }, &mut bytes)
        .unwrap_err();
    assert!(matches!(error, EncodeError::Mismatch { .. }), "{error}");
    assert_eq!(bytes, [1, 2, 3]);
}

#[test]
fn foreign_fields_are_skipped_and_absent_ones_are_zero() {
    let schema = schema::<Blob>();
    // Field 99 as a varint and as bytes, fields out of order, field 3 twice, field 1 absent.
    let bytes = [
        0x98, 6, 5, 0x18, 9, 0x12, 1, b'z', 0x9a, 6, 2, 0, 0, 0x18, 4,
    ];
    let blob: Blob = schema.decode(&bytes).unwrap();
    assert_eq!(
        blob,
        Blob {
            before: 0,
            text: "z".into(),
            after: 4
        }
    );
    assert_eq!(schema.decode::<Blob>(&[]).unwrap(), Blob::default());
    // A length far beyond the bytes.
    let bytes = [0x12, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f];
    let error = schema.decode::<Blob>(&bytes).unwrap_err();
    assert!(matches!(error, DecodeError::Malformed { .. }), "{error}");
}

#[test]
fn unknown_variants_are_errors() {
    let error = schema::<Mode>().decode::<Mode>(&[8, 9]).unwrap_err();
    assert!(
        matches!(
            error,
            DecodeError::UnknownVariant {
                number: 9,
                last: 1,
                ..
            }
        ),
        "{error}"
    );
    let error = schema::<Order>().decode::<Order>(&[]).unwrap_err();
    assert!(matches!(error, DecodeError::NoVariant { .. }), "{error}");
}

#[test]
fn schemas_are_shared_between_threads() {
    fn shared<T: Send + Sync>() {}
    shared::<Schema>();
    let _: SchemaError = Schema::of::<u32>().unwrap_err();
}
