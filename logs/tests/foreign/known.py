"""Writes known.mcap and known.json: messages that known tools have encoded, and what known tools read of them.

CDR of an IDL type by rosbags 0.11, ROS 1 by rosbags (read by mcap-ros1-support 0.9), protobuf with `Any` by
protobuf 7 and grpcio-tools. No package of PyPI encodes wide texts (`wstring`).

    pip install rosbags mcap mcap-ros1-support mcap-protobuf-support protobuf grpcio-tools numpy
    python known.py
"""
import json
from pathlib import Path
import numpy as np
from rosbags.typesys import Stores, get_typestore, get_types_from_idl, get_types_from_msg
from mcap.writer import Writer

IDL = '''
module demo_msgs {
  module msg {
    struct Part {
      octet id;
      double weight;
      sequence<short> marks;
    };
    struct Whole {
      octet a;
      uint8 u;
      double b;
      boolean c;
      unsigned short d;
      unsigned long long e;
      string f;
      long long g[3];
      sequence<double> h;
      octet i;
      sequence<demo_msgs::msg::Part> parts;
      demo_msgs::msg::Part one;
      sequence<string> words;
      float j;
      int8 k;
      long l;
    };
  };
};
'''
MSG = '''uint8 a
float64 b
bool c
uint16 d
time stamp
string f
int64[3] g
float64[] h
Part[] parts
Part one
string[] words
duration took
float32 j
int8 k
'''
PART = 'uint8 id\nfloat64 weight\nint16[] marks\n'

store = get_typestore(Stores.EMPTY)
store.register(get_types_from_idl(IDL))
T = store.types
Part, Whole = T['demo_msgs/msg/Part'], T['demo_msgs/msg/Whole']
parts = [Part(id=7, weight=0.25, marks=np.array([-1, 2, 300], dtype=np.int16)),
         Part(id=8, weight=-1e300, marks=np.array([], dtype=np.int16))]
one = Part(id=9, weight=3.5, marks=np.array([5], dtype=np.int16))
whole = Whole(a=100, u=200, b=1.5, c=True, d=65535, e=2**63 + 5, f='grüße', g=np.array([-1, 0, 2**40], dtype=np.int64),
              h=np.array([0.1, -0.0], dtype=np.float64), i=3, parts=parts, one=one, words=['', 'b', 'ccc'],
              j=0.5, k=-128, l=-2**31)

one_store = get_typestore(Stores.ROS1_NOETIC)
one_store.register(get_types_from_msg(PART, 'demo_msgs/msg/Part'))
one_store.register(get_types_from_msg(MSG, 'demo_msgs/msg/Whole'))
R = one_store.types
P1, W1 = R['demo_msgs/msg/Part'], R['demo_msgs/msg/Whole']
Time, Duration = R['builtin_interfaces/msg/Time'], R['builtin_interfaces/msg/Duration']
parts1 = [P1(id=p.id, weight=p.weight, marks=p.marks) for p in parts]
whole1 = W1(a=200, b=1.5, c=True, d=65535, stamp=Time(sec=4_000_000_000 % 2**31, nanosec=999_999_999), f='grüße',
            g=np.array([-1, 0, 2**40], dtype=np.int64), h=np.array([0.1, -0.0]), parts=parts1,
            one=P1(id=9, weight=3.5, marks=np.array([5], dtype=np.int16)), words=['', 'b', 'ccc'],
            took=Duration(sec=-3, nanosec=5), j=0.5, k=-128)

# protobuf with Any
from google.protobuf import timestamp_pb2
import sys
Path('held.proto').write_text('''syntax = "proto3";
package demo;
import "google/protobuf/any.proto";
import "google/protobuf/timestamp.proto";
message Inside { sint32 z = 1; fixed64 f = 2; repeated float r = 3; map<string, int32> m = 4; }
message Held { google.protobuf.Any a = 1; repeated google.protobuf.Any many = 2; google.protobuf.Timestamp t = 3;
  google.protobuf.Any unknown = 4; Inside inside = 5; }
''')
Path('other.proto').write_text('''syntax = "proto3";
package demo2;
message Other { string words = 1; }
''')
from grpc_tools import protoc
protoc.main(['', '-I.', '-I' + str(Path(protoc.__file__).parent / '_proto'), '--python_out=.', 'held.proto', 'other.proto'])
sys.path.insert(0, '.')
import held_pb2
import other_pb2
inside = held_pb2.Inside(z=-7, f=2**63 + 1, r=[0.5, -2.0], m={'x': -1})
held = held_pb2.Held(inside=inside)
held.a.Pack(inside)
x = held.many.add(); x.Pack(timestamp_pb2.Timestamp(seconds=12, nanos=34))
x = held.many.add(); x.Pack(inside)
other = other_pb2.Other(words='of another schema')
x = held.many.add(); x.Pack(other)
held.t.seconds = 1; held.t.nanos = 2
held.unknown.type_url = 'type.googleapis.com/gone.Type'; held.unknown.value = b'\x08\x01'
from mcap_protobuf.schema import build_file_descriptor_set
descriptors = build_file_descriptor_set(held_pb2.Held).SerializeToString()

def bar(name, text): return '=' * 80 + f'\nMSG: {name}\n{text}'
ros1 = MSG + bar('demo_msgs/Part', PART)
idl = '=' * 80 + '\nIDL: demo_msgs/msg/Whole\n' + IDL
out = open('known.mcap', 'wb')
w = Writer(out)
w.start('', 'rosbags, protobuf, mcap')
def put(topic, encoding, name, schema_encoding, schema, data):
    s = w.register_schema(name=name, encoding=schema_encoding, data=schema)
    c = w.register_channel(topic=topic, message_encoding=encoding, schema_id=s)
    w.add_message(channel_id=c, log_time=1, publish_time=1, data=bytes(data), sequence=0)
put('/idl/little', 'cdr', 'demo_msgs/msg/Whole', 'ros2idl', idl.encode(), store.serialize_cdr(whole, 'demo_msgs/msg/Whole', little_endian=True))
put('/idl/big', 'cdr', 'demo_msgs/msg/Whole', 'ros2idl', idl.encode(), store.serialize_cdr(whole, 'demo_msgs/msg/Whole', little_endian=False))
put('/ros1', 'ros1', 'demo_msgs/Whole', 'ros1msg', ros1.encode(), one_store.serialize_ros1(whole1, 'demo_msgs/msg/Whole'))
put('/other', 'protobuf', 'demo2.Other', 'protobuf', build_file_descriptor_set(other_pb2.Other).SerializeToString(), other.SerializeToString())
put('/any', 'protobuf', 'demo.Held', 'protobuf', descriptors, held.SerializeToString(deterministic=True))
w.finish(); out.close()

# What another reader makes of the bytes: mcap-ros1-support (genpy) for ROS 1, rosbags for CDR, protobuf's own JSON.
from mcap.reader import make_reader
from mcap_ros1.decoder import DecoderFactory as Ros1
def plain(x):
    if isinstance(x, np.ndarray): return [plain(v) for v in x.tolist()]
    if isinstance(x, (list, tuple)): return [plain(v) for v in x]
    if isinstance(x, (bool, int, float, str)): return x
    if isinstance(x, bytes): return list(x)
    if hasattr(x, '__slots__') and hasattr(x, 'secs'): return {'secs': x.secs, 'nsecs': x.nsecs}
    if hasattr(x, '__dataclass_fields__'): return {k: plain(getattr(x, k)) for k in x.__dataclass_fields__ if not k.startswith('__')}
    if hasattr(x, '__slots__'): return {k: plain(getattr(x, k)) for k in x.__slots__}
    raise TypeError(type(x))
values = {}
for schema, channel, message in make_reader(open('known.mcap', 'rb')).iter_messages():
    if channel.topic.startswith('/idl'):
        values[channel.topic] = plain(store.deserialize_cdr(message.data, 'demo_msgs/msg/Whole'))
    elif channel.topic == '/ros1':
        values[channel.topic] = plain(Ros1().decoder_for('ros1', schema)(message.data))
    elif channel.topic == '/other':
        values[channel.topic] = {'words': other_pb2.Other.FromString(message.data).words}
    else:
        packed = held_pb2.Inside.FromString(held_pb2.Held.FromString(message.data).a.value)
        values[channel.topic] = {'z': packed.z, 'f': packed.f, 'r': list(packed.r), 'm': dict(packed.m)}
Path('known.json').write_text(json.dumps(values, indent=1, ensure_ascii=False))
