//! What must hold for any value and any bytes.

use super::*;

fn order() -> impl Strategy<Value = Order> {
    let leaf = prop_oneof![
        Just(Order::Stop),
        prop::num::f64::NORMAL.prop_map(Order::Speed),
        vec(any::<(i32, i32)>(), 0..4).prop_map(Order::Via),
        (any::<u8>(), mode()).prop_map(|(number, mode)| Order::Pair(number, mode)),
        (prop::num::f64::NORMAL, any::<Option<String>>())
            .prop_map(|(x, note)| Order::Goto { x, note }),
        any::<Option<u64>>().prop_map(Order::Maybe),
        mode().prop_map(Order::Inner),
    ];
    leaf.prop_recursive(4, 8, 1, |inner| {
        inner.prop_map(|one| Order::Again(Box::new(one)))
    })
}

fn mode() -> impl Strategy<Value = Mode> {
    prop_oneof![Just(Mode::Idle), Just(Mode::Drive)]
}

fn meters() -> impl Strategy<Value = Meters> {
    prop_oneof![
        any::<u64>().prop_map(f64::from_bits),
        Just(-0.0),
        Just(f64::INFINITY)
    ]
    .prop_map(Meters)
}

fn single() -> impl Strategy<Value = Single> {
    prop_oneof![
        any::<u32>().prop_map(f32::from_bits),
        Just(-0.0),
        Just(f32::NAN)
    ]
    .prop_map(Single)
}

prop_compose! {
    fn numbers()(
        (a, b, c, d, e) in any::<(i8, i16, i32, i64, i128)>(),
        (f, g, h, i, j) in any::<(u8, u16, u32, u64, u128)>(),
        (k, l) in any::<(bool, char)>(),
        shift in 0_u32..64,
    ) -> Numbers {
        // Shifted, so that every length of varint turns up.
        Numbers { a, b, c, d: d >> shift, e, f, g, h: h >> (shift / 2), i: i >> shift, j, k, l }
    }
}

fn all() -> impl Strategy<Value = All> {
    let option = proptest::option::of::<BoxedStrategy<Mode>>;
    let leaf = (
        (
            numbers(),
            (meters(), single()),
            vec(single(), 0..40),
            vec(any::<String>(), 0..4),
        ),
        vec(any::<u8>(), 0..200).prop_map(Raw),
        (
            vec(proptest::option::of(order()), 0..4),
            proptest::option::of(order()),
        ),
        (
            btree_map(any::<String>(), any::<i64>(), 0..5),
            btree_map(mode(), vec(meters(), 0..4), 0..3),
            btree_map(any::<(u8, char)>(), any::<Option<u32>>(), 0..5),
        ),
        any::<[i32; 3]>(),
        proptest::option::of(vec(vec(option(mode().boxed()), 0..3), 0..3)),
        any::<(u8, String, Option<bool>)>(),
    )
        .prop_map(|(plain, raw, (orders, order), maps, array, deep, unlike)| {
            let (numbers, reals, list, words) = plain;
            let (by_name, by_mode, by_pair) = maps;
            All {
                numbers,
                reals,
                list,
                words,
                raw,
                orders,
                order,
                by_name,
                by_mode,
                by_pair,
                array,
                deep,
                unlike,
                tail: None,
            }
        });
    (vec(leaf, 1..4)).prop_map(|chain| {
        let link = |tail: Option<Box<All>>, one: All| Some(Box::new(All { tail, ..one }));
        *chain
            .into_iter()
            .fold(None, link)
            .expect("the chain has a link")
    })
}

proptest! {
    #[test]
    fn values_come_back_equal(value in all()) {
        let schema = schema::<All>();
        let bytes = encode(&schema, &value);
        prop_assert_eq!(schema.decode::<All>(&bytes).unwrap(), value);
        let message = foreign::dynamic(&schema, &bytes);
        prop_assert_eq!(message.unknown_fields().count(), 0);
    }

    #[test]
    fn equal_values_have_equal_bytes(value in all()) {
        let schema = schema::<All>();
        let bytes = encode(&schema, &value);
        let again = schema.decode::<All>(&bytes).unwrap();
        prop_assert_eq!(encode(&schema, &again), bytes);
    }

    #[test]
    fn random_bytes_never_panic(bytes in vec(any::<u8>(), 0..300)) {
        let _ = schema::<All>().decode::<All>(&bytes);
        let _ = schema::<Order>().decode::<Order>(&bytes);
    }

    #[test]
    fn damaged_messages_never_panic(value in all(), hits in vec(any::<(u16, u8)>(), 1..6)) {
        let schema = schema::<All>();
        let mut bytes = encode(&schema, &value);
        for (at, byte) in hits {
            let at = usize::from(at) % bytes.len();
            bytes[at] = byte;
        }
        let _ = schema.decode::<All>(&bytes);
        bytes.truncate(bytes.len() / 2);
        let _ = schema.decode::<All>(&bytes);
    }
}
