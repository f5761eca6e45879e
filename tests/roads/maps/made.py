"""Objects of an OpenStreetMap extract as XML."""


def tags_xml(tags):
    return "".join(f'<tag k="{k.replace("__", ":")}" v="{v}"/>' for k, v in tags.items())


def osm(*objects):
    return f'<?xml version="1.0"?><osm version="0.6">{"".join(objects)}</osm>'


def node(number, latitude, longitude, **tags):
    return f'<node id="{number}" lat="{latitude}" lon="{longitude}">{tags_xml(tags)}</node>'


def way(number, nodes, **tags):
    inside = "".join(f'<nd ref="{k}"/>' for k in nodes)
    return f'<way id="{number}">{inside}{tags_xml(tags)}</way>'
