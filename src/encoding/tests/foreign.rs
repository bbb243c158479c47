//! Other protobuf implementations agree with this one.

use prost::Message;
use prost_reflect::{Cardinality, DescriptorPool, DynamicMessage, Kind};

use super::*;

/// Decodes by the descriptor alone.
pub(super) fn dynamic(schema: &Schema, bytes: &[u8]) -> DynamicMessage {
    let pool = DescriptorPool::decode(schema.file_descriptor_set().as_slice()).unwrap();
    let message = pool.get_message_by_name(&schema.full_name()).unwrap();
    DynamicMessage::decode(message, bytes).unwrap()
}

#[derive(Serialize, Deserialize, PartialEq, Clone, Message)]
struct Plain {
    #[prost(uint64, tag = "1")]
    a: u64,
    #[prost(int32, tag = "2")]
    b: i32,
    #[prost(int64, tag = "3")]
    c: i64,
    #[prost(uint32, tag = "4")]
    d: u32,
    #[prost(double, tag = "5")]
    e: f64,
    #[prost(float, tag = "6")]
    f: f32,
    #[prost(bool, tag = "7")]
    g: bool,
    #[prost(string, tag = "8")]
    h: String,
    #[prost(double, repeated, tag = "9")]
    i: Vec<f64>,
    #[prost(uint64, repeated, tag = "10")]
    j: Vec<u64>,
    #[prost(string, repeated, tag = "11")]
    k: Vec<String>,
    #[prost(message, optional, tag = "12")]
    l: Option<Box<Plain>>,
    #[prost(message, repeated, tag = "13")]
    m: Vec<Plain>,
    #[prost(uint32, optional, tag = "14")]
    n: Option<u32>,
    #[prost(btree_map = "string, int64", tag = "15")]
    o: BTreeMap<String, i64>,
    #[prost(int32, repeated, tag = "16")]
    p: Vec<i32>,
    #[prost(bool, repeated, tag = "17")]
    q: Vec<bool>,
}

fn plain() -> impl Strategy<Value = Plain> {
    // prost leaves zeros out, this encoding does not.
    let leaf = (
        (
            1..u64::MAX,
            1..i32::MAX,
            i64::MIN..0,
            1..u32::MAX,
            0.1..1e9,
            "[a-zé]{1,200}",
        ),
        (
            vec(any::<f64>(), 0..30),
            vec(any::<u64>(), 0..30),
            vec(".*", 0..4),
        ),
        proptest::option::of(any::<u32>()),
        // Keys of one length, since only those sort alike by text and by encoding; no value is
        // zero.
        btree_map("[a-z]{3}", 1..i64::MAX, 0..4),
        (vec(any::<i32>(), 0..200), vec(any::<bool>(), 0..9)),
    )
        .prop_map(|((a, b, c, d, e, h), (i, j, k), n, o, (p, q))| {
            let (f, g, l, m) = (e as f32, true, None, vec![]);
            Plain {
                a,
                b,
                c,
                d,
                e,
                f,
                g,
                h,
                i,
                j,
                k,
                l,
                m,
                n,
                o,
                p,
                q,
            }
        });
    leaf.prop_recursive(3, 8, 3, |inner| {
        (
            inner.clone(),
            proptest::option::of(inner.clone()),
            vec(inner, 0..3),
        )
            .prop_map(|(plain, l, m)| Plain {
                l: l.map(Box::new),
                m,
                ..plain
            })
    })
}

proptest! {
    #[test]
    fn plain_messages_are_prosts_bytes(value in plain()) {
        let schema = schema::<Plain>();
        let bytes = encode(&schema, &value);
        prop_assert_eq!(&bytes, &value.encode_to_vec());
        prop_assert_eq!(schema.decode::<Plain>(&bytes).unwrap(), value);
    }

    #[test]
    fn zeros_that_prost_leaves_out_are_read(mut value in plain()) {
        (value.a, value.b, value.e, value.h) = (0, 0, 0.0, String::new());
        let schema = schema::<Plain>();
        prop_assert_eq!(schema.decode::<Plain>(&value.encode_to_vec()).unwrap(), value);
    }
}

#[test]
fn lengths_are_as_short_as_prosts() {
    #[derive(Serialize, Deserialize, PartialEq, Clone, Message)]
    struct Inner {
        #[prost(string, tag = "1")]
        text: String,
    }
    #[derive(Serialize, Deserialize, PartialEq, Clone, Message)]
    struct Around {
        #[prost(message, required, tag = "1")]
        inner: Inner,
        #[prost(uint32, repeated, tag = "2")]
        small: Vec<u32>,
    }
    let schema = schema::<Around>();
    for len in (1..300).chain(16_370..16_400) {
        let text = "x".repeat(len);
        let small = vec![if len % 2 == 0 { 1 } else { 300 }; len];
        let value = Around {
            inner: Inner { text },
            small,
        };
        assert_eq!(encode(&schema, &value), value.encode_to_vec(), "{len}");
    }
}

#[test]
fn the_descriptor_names_every_field() {
    let order = Order::Goto {
        x: 1.5,
        note: Some("n".into()),
    };
    let orders = Wrapper {
        inner: vec![Some(order), None, Some(Order::Inner(Mode::Drive))],
    };
    let schema = schema::<Wrapper<Vec<Option<Order>>>>();
    let json = serde_json::to_value(dynamic(&schema, &encode(&schema, &orders))).unwrap();
    let expected = serde_json::json!({ "inner": [
        { "value": { "goto": { "x": 1.5, "note": "n" } } },
        {},
        { "value": { "inner": "MODE_DRIVE" } },
    ] });
    assert_eq!(json, expected);
}

#[test]
fn fields_have_the_promised_types() {
    let schema = schema::<Nested>();
    let pool = DescriptorPool::decode(schema.file_descriptor_set().as_slice()).unwrap();
    assert_eq!(pool.files().count(), 1);
    assert_eq!(
        pool.files().next().unwrap().name(),
        "farside/msg/Nested.proto"
    );
    let message = pool.get_message_by_name("farside.msg.Nested").unwrap();
    let field = |name: &str| message.get_field_by_name(name).unwrap();
    assert!(field("lists").is_map());
    assert_eq!(field("odd").cardinality(), Cardinality::Repeated);
    assert!(matches!(field("odd").kind(), Kind::Message(_)));
    assert!(field("set").is_packed());
    let numbers: Vec<u32> = message.fields().map(|field| field.number()).collect();
    assert_eq!(numbers, (1..=13).collect::<Vec<_>>());
    let plain = super::schema::<Plain>();
    let pool = DescriptorPool::decode(plain.file_descriptor_set().as_slice()).unwrap();
    let message = pool.get_message_by_name("farside.msg.Plain").unwrap();
    assert!(message.get_field_by_name("n").unwrap().supports_presence());
    assert!(!message.get_field_by_name("a").unwrap().supports_presence());
    let oneof = message
        .get_field_by_name("n")
        .unwrap()
        .containing_oneof()
        .unwrap();
    assert!(oneof.is_synthetic());
}

#[test]
fn another_file_can_import_the_root() {
    use super::super::wire::{Tag, Wire, put_bytes, put_varint};
    let schema = schema::<Order>();
    let put = |out: &mut Vec<u8>, number, bytes: &[u8]| {
        put_bytes(out, Tag::new(number, Wire::Bytes), bytes);
    };
    let (mut field, mut message, mut file) = (vec![], vec![], vec![]);
    put(&mut field, 1, b"body");
    for (number, value) in [(3, 1), (4, 1), (5, 11)] {
        put_varint(&mut field, Tag::new(number, Wire::Varint), value);
    }
    put(&mut field, 6, format!(".{}", schema.full_name()).as_bytes());
    put(&mut message, 1, b"Envelope");
    put(&mut message, 2, &field);
    put(&mut file, 1, b"envelope.proto");
    put(&mut file, 3, schema.file_name().as_bytes());
    put(&mut file, 4, &message);
    put(&mut file, 12, b"proto3");
    let mut set = schema.file_descriptor_set();
    put(&mut set, 1, &file);
    let pool = DescriptorPool::decode(set.as_slice()).unwrap();
    let body = pool
        .get_message_by_name("Envelope")
        .unwrap()
        .get_field(1)
        .unwrap();
    assert_eq!(
        body.kind().as_message().unwrap().full_name(),
        "farside.msg.Order"
    );
}
