"""Opens a log of Farside in Rerun, with map, plots and events: python rerun_view.py run.mcap

Needs `pip install rerun-sdk mcap mcap-protobuf-support`. Rerun reads the log by itself, and knows
frames, text and fields in it. It does not know `/scene`, the shapes that Foxglove draws: this draws
them for it. The rest is a blueprint: what is shown where, and which fields are plotted.
"""
import argparse

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

SCENE, FRAMES, EVENTS = "/scene", "/tf", "/log"
# What is plotted: the schema of state samples, a field of it, and what it is.
PLOTS = [("NodeState", "rovers", "rovers that a node guides"), ("NodeState", "load", "load of a node")]
TIMELINE = "message_log_time"


def of(points):
    return [[point.x, point.y, point.z] for point in points]


def rgba(colours):
    return [[colour.r, colour.g, colour.b, colour.a] for colour in colours]


def draw(entity):
    """Draws what Foxglove would of an entity below `/scene`."""
    path = f"{SCENE}/{entity.id}"
    rr.log(path, rr.CoordinateFrame(entity.frame_id))
    strips, colours, radii = [], [], []
    for line in entity.lines:
        points = np.array(of(line.points))[list(line.indices) or slice(None)]
        strips.extend(points.reshape(-1, 2, 3))
        colours.extend(rgba([line.color]) * (len(points) // 2))
        radii.extend([line.thickness / 2] * (len(points) // 2))
    if strips:
        rr.log(path, rr.LineStrips3D(strips, colors=colours, radii=radii))
    names = [text.text for text in entity.texts] or None
    for shapes, draws in [(entity.cubes, rr.Boxes3D), (entity.spheres, rr.Ellipsoids3D)]:
        if shapes:
            centers = of(shape.pose.position for shape in shapes)
            half_sizes = np.array(of(shape.size for shape in shapes)) / 2
            colours = rgba(shape.color for shape in shapes)
            rr.log(path, draws(centers=centers, half_sizes=half_sizes, colors=colours, labels=names,
                               fill_mode="solid", show_labels=True))


def plot(topics, schema, field, name):
    """A plot with a line for each topic of this schema."""
    number = VisualizerComponentMapping(
        target="Scalars:scalars",
        source_kind=ComponentSourceKind.SourceComponent,
        source_component=f"farside.msg.{schema}:message",
        selector=f".{field}",
    )
    lines = [topic for topic, of_topic in topics.items() if of_topic == f"farside.msg.{schema}"]
    drawn = {topic: rr.SeriesLines().visualizer(mappings=[number]) for topic in lines}
    return rrb.TimeSeriesView(origin="/", contents=[f"+ {topic}" for topic in lines], name=name,
                              overrides=drawn, plot_legend=rrb.PlotLegend(visible=False))


def main():
    options = argparse.ArgumentParser()
    options.add_argument("log", help="a log, as farside run writes it")
    options.add_argument("--save", metavar="RRD", help="write a recording with its blueprint instead")
    given = options.parse_args()
    with open(given.log, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        schemas = summary.schemas
        topics = {one.topic: schemas[one.schema_id].name for one in summary.channels.values()}
        shown = rrb.Spatial3DView(
            origin="/", contents=[f"+ {SCENE}/**", f"+ {FRAMES}"], name="map",
            line_grid=False,
            eye_controls=rrb.EyeControls3D(position=(0, -390, 400), look_target=(0, -25, 0)),
        )
        told = rrb.TextLogView(origin=EVENTS, name="events")
        plots = [plot(topics, *what) for what in PLOTS]
        blueprint = rrb.Blueprint(
            rrb.Horizontal(shown, rrb.Vertical(*plots, told), column_shares=[3, 2]),
            rrb.TimePanel(timeline=TIMELINE, state="collapsed"), rrb.SelectionPanel(state="hidden"),
            rrb.BlueprintPanel(state="hidden"),
        )
        rr.init("farside", spawn=given.save is None)
        if given.save is None:
            rr.send_blueprint(blueprint)
        else:
            rr.save(given.save, default_blueprint=blueprint)
        # What is not drawn yet stands in Rerun's own frame: say how that and the map's are one.
        rr.log("map", rr.Transform3D(parent_frame="tf#/", child_frame="map"), static=True)
        rr.log_file_from_path(given.log)
        layers = [topic for topic in topics if topic.startswith(SCENE)]
        drawn = {}
        for _, _, message, update in reader.iter_decoded_messages(topics=layers):
            rr.set_time(TIMELINE, timestamp=np.datetime64(message.log_time, "ns"))
            for gone in update.deletions:
                rr.log(f"{SCENE}/{gone.id}", rr.Clear(recursive=True))
                drawn.pop(gone.id, None)
            # A message has all of its layer: draw what is new in it.
            for entity in update.entities:
                if drawn.get(entity.id) != entity:
                    drawn[entity.id] = entity
                    draw(entity)


if __name__ == "__main__":
    main()
