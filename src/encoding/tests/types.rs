//! The message types that the tests encode.

// The hash collections among them are there to be refused.
#![allow(clippy::disallowed_types)]

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroU32;

use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Unit;

/// Compares by bits, but any NaN equals any other.
#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct Meters(pub(super) f64);

impl PartialEq for Meters {
    fn eq(&self, other: &Self) -> bool {
        (self.0.is_nan() && other.0.is_nan()) || self.0.to_bits() == other.0.to_bits()
    }
}

#[derive(Serialize, Deserialize, Clone, Copy, Debug)]
pub(super) struct Single(pub(super) f32);

impl PartialEq for Single {
    fn eq(&self, other: &Self) -> bool {
        (self.0.is_nan() && other.0.is_nan()) || self.0.to_bits() == other.0.to_bits()
    }
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Rows(pub(super) Vec<Vec<u64>>);

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Reals {
    pub(super) values: Vec<f64>,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Corner(pub(super) u8, pub(super) i16, pub(super) String);

#[derive(Serialize, Deserialize, PartialEq, Eq, PartialOrd, Ord, Clone, Copy, Debug)]
pub(super) enum Mode {
    Idle,
    Drive,
}

#[derive(Serialize, Deserialize, PartialEq, Clone, Debug)]
pub(super) enum Order {
    Again(Box<Order>),
    Stop,
    Speed(f64),
    Via(Vec<(i32, i32)>),
    Pair(u8, Mode),
    Goto { x: f64, note: Option<String> },
    Maybe(Option<u64>),
    Inner(Mode),
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Tree(pub(super) Vec<Tree>);

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Wrapped(pub(super) Tree);

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct List {
    pub(super) value: u32,
    pub(super) next: Option<Box<List>>,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) enum Expr {
    Add(Box<Expr>, Box<Expr>),
    Neg(Box<Expr>),
    Num(f64),
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Holder {
    pub(super) trees: Wrapped,
    pub(super) pair: Option<Box<(u8, Option<Holder>)>>,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Nested {
    pub(super) twice: Option<Option<u32>>,
    pub(super) thrice: Option<Option<Option<String>>>,
    pub(super) rows: Vec<Vec<f64>>,
    pub(super) gaps: Vec<Option<i64>>,
    pub(super) list: Option<Vec<u8>>,
    pub(super) lists: BTreeMap<String, Vec<u16>>,
    pub(super) odd: BTreeMap<(i8, bool), Option<Mode>>,
    pub(super) modes: Vec<Option<Mode>>,
    pub(super) set: BTreeSet<u32>,
    pub(super) units: Vec<()>,
    pub(super) empty: [u32; 0],
    pub(super) chars: [[char; 2]; 2],
    pub(super) map_of_maps: Option<BTreeMap<i32, BTreeMap<bool, char>>>,
}

fn seven() -> u32 {
    7
}

fn is_seven(value: &u32) -> bool {
    *value == 7
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
#[serde(rename_all = "kebab-case")]
pub(super) struct Attributes {
    pub(super) kebab_name: u32,
    #[serde(rename = "type")]
    pub(super) kind: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) shown: Option<u32>,
    #[serde(default = "seven", skip_serializing_if = "is_seven")]
    pub(super) seven: u32,
    #[serde(alias = "zz", alias = "aa")]
    pub(super) aliased: u32,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) enum SkippedVariant {
    A,
    #[serde(skip)]
    #[allow(dead_code)] // It is there to shift the numbers of those after it.
    B,
    #[serde(alias = "AAA")]
    C,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
#[serde(rename = "Wanted")]
pub(super) struct Renamed {
    pub(super) x: u32,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
#[serde(transparent)]
pub(super) struct Transparent {
    pub(super) inner: Meters,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
#[serde(try_from = "u32", into = "u32")]
pub(super) struct Low(pub(super) u32);

impl Clone for Low {
    fn clone(&self) -> Low {
        Low(self.0)
    }
}

impl TryFrom<u32> for Low {
    type Error = String;

    fn try_from(value: u32) -> Result<Low, String> {
        if (1..10).contains(&value) {
            Ok(Low(value))
        } else {
            Err(format!("{value} is not low"))
        }
    }
}

impl From<Low> for u32 {
    fn from(low: Low) -> u32 {
        low.0
    }
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Bounded {
    pub(super) low: Low,
    pub(super) count: NonZeroU32,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Wrapper<T> {
    pub(super) inner: T,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Point {
    pub(super) x: u32,
}

pub(super) mod other {
    use super::*;

    #[derive(Serialize, Deserialize, PartialEq, Debug)]
    pub(in super::super) struct Point {
        pub(in super::super) y: Vec<f64>,
    }
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Twins {
    pub(super) number: Wrapper<u32>,
    pub(super) text: Wrapper<String>,
    pub(super) here: Point,
    pub(super) there: other::Point,
}

#[derive(Serialize, Deserialize, PartialEq, Debug, Default)]
pub(super) struct Blob {
    pub(super) before: u32,
    pub(super) text: String,
    pub(super) after: u32,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Outer {
    pub(super) blob: Blob,
    pub(super) tail: u8,
}

/// A map that is written in the order it is in.
#[derive(PartialEq, Debug)]
pub(super) struct Pairs(pub(super) Vec<(u32, u32)>);

impl Serialize for Pairs {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (key, value) in &self.0 {
            map.serialize_entry(key, value)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for Pairs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Pairs, D::Error> {
        Ok(Pairs(
            BTreeMap::deserialize(deserializer)?.into_iter().collect(),
        ))
    }
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct Counts {
    pub(super) by_name: Pairs,
}

/// Bytes as `serialize_bytes` writes them.
#[derive(PartialEq, Clone, Debug)]
pub(super) struct Raw(pub(super) Vec<u8>);

impl Serialize for Raw {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(&self.0)
    }
}

impl<'de> Deserialize<'de> for Raw {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Raw, D::Error> {
        struct Bytes;
        impl serde::de::Visitor<'_> for Bytes {
            type Value = Raw;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("bytes")
            }
            fn visit_bytes<E>(self, bytes: &[u8]) -> Result<Raw, E> {
                Ok(Raw(bytes.to_vec()))
            }
        }
        deserializer.deserialize_byte_buf(Bytes)
    }
}

/// One of everything.
#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub(super) struct All {
    pub(super) numbers: Numbers,
    pub(super) reals: (Meters, Single),
    pub(super) list: Vec<Single>,
    pub(super) words: Vec<String>,
    pub(super) raw: Raw,
    pub(super) orders: Vec<Option<Order>>,
    pub(super) order: Option<Order>,
    pub(super) by_name: BTreeMap<String, i64>,
    pub(super) by_mode: BTreeMap<Mode, Vec<Meters>>,
    pub(super) by_pair: BTreeMap<(u8, char), Option<u32>>,
    pub(super) array: [i32; 3],
    pub(super) deep: Option<Vec<Vec<Option<Mode>>>>,
    pub(super) unlike: (u8, String, Option<bool>),
    pub(super) tail: Option<Box<All>>,
}

#[derive(Serialize, Deserialize, PartialEq, Clone, Debug)]
pub(super) struct Numbers {
    pub(super) a: i8,
    pub(super) b: i16,
    pub(super) c: i32,
    pub(super) d: i64,
    pub(super) e: i128,
    pub(super) f: u8,
    pub(super) g: u16,
    pub(super) h: u32,
    pub(super) i: u64,
    pub(super) j: u128,
    pub(super) k: bool,
    pub(super) l: char,
}

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct HasFlatten {
    #[serde(flatten)]
    pub(super) point: Point,
}

#[derive(Serialize, Deserialize, Debug)]
#[serde(untagged)]
pub(super) enum Either {
    Left(u32),
    Right(String),
}

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct HasUntagged {
    pub(super) either: Either,
}

#[derive(Serialize, Deserialize, Debug)]
#[serde(tag = "type")]
pub(super) enum Internal {
    A { x: u32 },
}

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct HasInternal {
    pub(super) inner: Internal,
}

#[derive(Serialize, Deserialize, Debug)]
#[serde(tag = "t", content = "c")]
pub(super) enum Adjacent {
    A(u32),
    B(String),
}

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct HasAdjacent {
    pub(super) inner: Adjacent,
}

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct HasHashMap {
    pub(super) map: std::collections::HashMap<u32, u32>,
}

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct HasHashSet {
    pub(super) set: std::collections::HashSet<u32>,
}

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct Endless {
    pub(super) inner: Box<Endless>,
}

#[derive(Serialize, Deserialize, Debug)]
pub(super) enum NoVariant {}

#[derive(Serialize, Deserialize, Debug)]
pub(super) enum AllSkipped {
    #[serde(skip)]
    #[expect(dead_code, reason = "there to be skipped")]
    A,
}

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct HasNoVariant {
    pub(super) number: u32,
    pub(super) rest: Vec<Option<NoVariant>>,
}

#[derive(Serialize, Debug)]
pub(super) struct Picky {
    pub(super) never: Never,
}

#[derive(Serialize, Debug)]
pub(super) struct Never(u32);

impl<'de> Deserialize<'de> for Never {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Never, D::Error> {
        u32::deserialize(deserializer)?;
        Err(serde::de::Error::custom("never good enough"))
    }
}

impl<'de> Deserialize<'de> for Picky {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Picky, D::Error> {
        #[derive(Deserialize)]
        #[serde(rename = "Picky")]
        struct Inner {
            never: Never,
        }
        Ok(Picky {
            never: Inner::deserialize(deserializer)?.never,
        })
    }
}

#[derive(Serialize, Deserialize, Debug)]
pub(super) struct Asymmetric {
    #[serde(rename(serialize = "a", deserialize = "b"))]
    pub(super) x: u32,
}
