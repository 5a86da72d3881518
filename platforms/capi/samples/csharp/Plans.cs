// A floor plan with a door, and what can be seen from a box around an eye: by a sweep, by rays and proofs, by a ray.
using System;

static class Plans
{
    static void Expect(string what, ulong found, ulong expected) => Street.Expect(what, found, expected);

    static Vis.Wall Wall(double x, double y, double toX, double toY) =>
        new Vis.Wall { FromX = x, FromY = y, ToX = toX, ToY = toY };

    // Two rooms of 4 m; wall 5 is the door between them.
    static void LookAround()
    {
        Vis.Wall[] walls = {
            Wall(0, 0, 8, 0), Wall(8, 0, 8, 4), Wall(8, 4, 0, 4), Wall(0, 4, 0, 0), Wall(4, 0, 4, 3),
            Wall(4, 3, 4, 4) };
        double[] guard = { 2, 3.5 }, thief = { 6, 3.5 };
        var seen = new uint[6];
        UIntPtr six = (UIntPtr)6, count;
        Vis.Check(Vis.vis_plan_create(walls, six, out IntPtr plan));
        Vis.Check(Vis.vis_plan_sees(plan, guard, thief, out bool sees));
        Expect("sees the thief", sees ? 1u : 0u, 0);
        Vis.Check(Vis.vis_plan_ray(plan, guard, thief, out Vis.WallHit hit));
        Expect("the ray ends at", hit.X == 4 && hit.Y == 3.5 ? hit.Wall : Vis.NoWall, 5);
        Vis.Check(Vis.vis_plan_visible_walls(plan, guard, double.PositiveInfinity, seen, six, out count));
        Expect("walls of the room", (ulong)count, 5);
        double[] none = null;
        Vis.Check(Vis.vis_plan_visibility_polygon(plan, guard, double.PositiveInfinity, none, UIntPtr.Zero, out count));
        var corners = new double[(int)count];
        Vis.Check(Vis.vis_plan_visibility_polygon(plan, guard, double.PositiveInfinity, corners, count, out count));
        double area = 0;
        for (int i = 0, n = corners.Length; i < n; i += 2)
            area += (corners[i] * corners[(i + 3) % n] - corners[(i + 2) % n] * corners[i + 1]) / 2;
        Expect("square metres seen", (ulong)Math.Round(area), 16);

        Vis.Check(Vis.vis_plan_set_opacity(plan, 5, Vis.Clear));
        Vis.Check(Vis.vis_plan_sees(plan, guard, thief, out sees));
        Expect("sees, door open", sees ? 1u : 0u, 1);
        double[] region = { 1, 1, 2, 1, 2, 3, 1, 3 };
        Vis.Check(Vis.vis_plan_walls_seen_from_region(plan, region, (UIntPtr)4, seen, six, out count));
        Expect("walls from a region", (ulong)count, 6);
        Vis.vis_plan_destroy(plan);
    }

    // A wall, a lamp behind it and one before it, as seen from a box around the origin.
    static void LookFromBox()
    {
        var box = new Vis.Box(4, -9, -9, 5, 9, 9);
        Vis.ObjectDesc[] objects = {
            Vis.vis_object_default(box), Vis.vis_object_default(new Vis.Box(7, -1, -1, 8, 1, 1)),
            Vis.vis_object_default(new Vis.Box(2, 2, 2, 3, 3, 3)) };
        objects[0].Flags = Vis.Occluder;
        var ids = new ulong[3];
        UIntPtr three = (UIntPtr)3, count;
        Vis.Check(Vis.vis_scene_create(out IntPtr scene));
        Vis.Check(Vis.vis_scene_insert_batch(scene, objects, three, ids));
        // Triangles for the proofs, and a mesh for the sweep, after them: one face of the wall.
        float[] face = { 4, -9, -9, 4, 9, -9, 4, 9, 9, 4, -9, -9, 4, 9, 9, 4, -9, 9 };
        float[] lamp = { 2, 2, 2, 3, 3, 2, 3, 3, 3 };
        Vis.Check(Vis.vis_scene_set_triangles(scene, ids[0], face, (UIntPtr)2));
        Vis.Check(Vis.vis_scene_set_triangles(scene, ids[2], lamp, (UIntPtr)1));
        Vis.Check(Vis.vis_scene_add_box_mesh(scene, ref box, out ulong mesh));
        Vis.Check(Vis.vis_scene_set_mesh(scene, ids[0], mesh, null));
        Vis.Check(Vis.vis_scene_rebuild(scene));
        double[] min = { -0.5, -0.5, -0.5 }, max = { 0.5, 0.5, 0.5 };
        var words = new uint[2];
        Vis.Check(Vis.vis_scene_seen_from(scene, min, max, words, (UIntPtr)2, out count));
        Expect("words", (ulong)count, 1);
        Expect("seen by the sweep", words[0], 5);
        Vis.Check(Vis.vis_scene_prove_from(scene, min, max, 0, 0, words, (UIntPtr)2, out count));
        Expect("seen by a ray", words[0], 5);
        Expect("proven hidden", words[1], 2);
        float[] origin = { 0, 0, 0 }, along = { 1, 0, 0 };
        Vis.Check(Vis.vis_scene_first_hit(scene, origin, along, 100, Vis.AllLayers, out Vis.RayHit hit));
        Expect("the ray hits the wall", hit.Object == ids[0] ? 1u : 0u, 1);
        var area = new Vis.Box(6, -2, -2, 9, 2, 2);
        var found = new ulong[3];
        Vis.Check(Vis.vis_scene_in_box(scene, ref area, Vis.AllLayers, found, three, out count));
        Expect("lamps in a box", found[0] == ids[1] ? (ulong)count : 0, 1);
        Vis.vis_scene_destroy(scene);
    }

    public static void Run()
    {
        LookAround();
        LookFromBox();
    }
}
