"""What a camera in a city covers: the houses in its picture, and the street around it."""

import figure
import numpy as np
from matplotlib.patches import Rectangle
from visibility import Plan, Scene, View

# A town of this file: blocks of houses along streets, with squares and heights that vary. Metres.
random = np.random.default_rng(7)
houses = []
for row in range(9):
    for column in range(9):
        if (row, column) in ((4, 4), (2, 6)):
            continue  # squares
        x, y = 46.0 * column, 40.0 * row
        for lot in range(3):
            low = np.array([x + 12.0 * lot, y + random.uniform(0, 3), 0.0])
            houses.append([low, low + [random.uniform(9.5, 12), random.uniform(20, 27), random.uniform(8, 30)]])
houses = np.array(houses)
ground = np.array([[[-60, -60, -1], [480, 420, 0]]], dtype=np.float64)

scene = Scene(origin=(200, 180, 0))
scene.add_boxes(np.concatenate([ground, houses]))
eye, target = np.array([178.0, 194.0, 6.0]), np.array([260.0, 165.0, 1.0])
view = View.perspective(eye, target, fov_y=0.9)
in_view = scene.cull(view, occlusion=False)
visible = scene.cull(view)
image = scene.item_buffer(view, size=(960, 540))
shown = np.unique(image[image >= 0])
missed, _ = scene.compare(view, visible, size=(960, 540))
print(f"{len(in_view)} of {len(scene)} objects in the view, {len(visible)} reported, {len(shown)} shown in pixels")
assert len(missed) == 0 and len(visible) < len(in_view)

# On the plan: what a camera that turns covers of the street at head height.
plan = Plan.from_polygons([[(a[0], a[1]), (b[0], a[1]), (b[0], b[1]), (a[0], b[1])] for a, b in houses])
turn = np.array([[0.0, -1.0], [1.0, 0.0]])
ahead = (target - eye)[:2] / np.hypot(*(target - eye)[:2])
half = np.arctan(np.tan(0.45) * 16 / 9)
right = eye[:2] + 10 * (np.cos(half) * ahead - np.sin(half) * turn @ ahead)
left = eye[:2] + 10 * (np.cos(half) * ahead + np.sin(half) * turn @ ahead)
covered = plan.visibility_polygon(eye[:2], range=250.0, sector=(right, left))
around = plan.visibility_polygon(eye[:2], range=250.0)

picture, (axes, screen) = figure.plt.subplots(1, 2, figsize=(14, 6), layout="constrained")
figure.fill(axes, [around], figure.SEEN, alpha=0.3)
figure.fill(axes, [covered], figure.SEEN, alpha=0.9)
for number, (low, high) in enumerate(houses, start=1):
    color = figure.MORE if number in shown else "#8d99ae" if number in in_view else "#d9dce3"
    axes.add_patch(Rectangle(low[:2], *(high - low)[:2], color=color, zorder=2))
figure.eyes(axes, eye[None, :2])
axes.set(title="Street covered; houses shown (orange), in the view but hidden (grey-blue)", xlabel="m", aspect="equal")
axes.autoscale_view()
tones = np.concatenate([[[0.75, 0.86, 0.95]], [[0.6, 0.62, 0.6]], random.uniform(0.3, 0.95, (len(houses), 3))])
screen.imshow(tones[image + 1])
screen.set(title=f"The camera's picture: {len(shown)} of {len(scene)} objects", xticks=[], yticks=[])
figure.save(picture, "street_camera.png")
