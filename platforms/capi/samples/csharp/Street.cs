// A street with a wall that hides boxes, as in street.c, sets made ahead of an eye, and who sees whom, by
// the functions of Vis.cs.
using System;
using System.Collections.Generic;

static class Street
{
    public static void Expect(string what, ulong found, ulong expected)
    {
        Console.WriteLine($"{what,-22} {found,4}");
        if (found != expected)
            throw new InvalidOperationException($"{what}: {found}, not {expected}");
    }

    static Vis.ObjectDesc BoxAt(float x, float y, float z) =>
        Vis.vis_object_default(new Vis.Box(x, y, z, x + 1.0f, y + 0.5f, z + 0.4f));

    static void Main()
    {
        Expect("version", Vis.vis_abi_version(), Vis.AbiVersion);
        var boxes = new List<Vis.ObjectDesc>();
        for (int i = 0; i < 8; i++) boxes.Add(BoxAt(10.0f, -4.0f + i, 0.0f));
        for (int i = 0; i < 100; i++) boxes.Add(BoxAt(30.0f, -4.5f + i % 10, 0.5f * (i / 10)));
        for (int i = 0; i < 5; i++) boxes.Add(BoxAt(30.0f, 12.0f + 2.0f * i, 0.0f));
        for (int i = 0; i < 40; i++) boxes.Add(BoxAt(-20.0f, i, 0.0f));
        var wall = Vis.vis_object_default(new Vis.Box(20.0f, -6.0f, 0.0f, 20.5f, 6.0f, 8.0f));
        wall.Flags = Vis.Occluder;
        boxes.Add(wall);

        var ids = new ulong[boxes.Count];
        Vis.Check(Vis.vis_scene_create(out IntPtr scene));
        Vis.Check(Vis.vis_scene_insert_batch(scene, boxes.ToArray(), (UIntPtr)boxes.Count, ids));
        Vis.Check(Vis.vis_scene_add_box_mesh(scene, ref wall.Bounds, out ulong mesh));
        Vis.Check(Vis.vis_scene_set_mesh(scene, ids[ids.Length - 1], mesh, null));
        Vis.Check(Vis.vis_scene_rebuild(scene));
        Vis.Check(Vis.vis_pipeline_create(out IntPtr pipeline));
        Vis.Check(Vis.vis_pipeline_add_frustum(pipeline));
        Vis.Check(Vis.vis_pipeline_add_z_buffer(pipeline, UIntPtr.Zero, UIntPtr.Zero));
        Vis.Check(Vis.vis_view_create(out IntPtr view));
        Vis.Check(Vis.vis_visible_create(false, out IntPtr visible));

        // The matrix of street.c: column-major, reversed depth without a far plane.
        const float fy = 1.8305f, fx = fy * 9.0f / 16.0f, eye = 1.7f, near = 0.1f;
        float[] matrix = { 0, 0, 0, 1, -fx, 0, 0, 0, 0, fy, 0, 0, 0, -fy * eye, near, 0 };
        Vis.Check(Vis.vis_view_set_matrix(view, matrix, Vis.DepthReversedInfinite, null));
        Vis.Check(Vis.vis_pipeline_cull(pipeline, scene, view, visible, out Vis.Stats sum));
        Vis.Check(Vis.vis_pipeline_stage_stats(pipeline, UIntPtr.Zero, out Vis.Stats frustum));
        Expect("objects", (ulong)boxes.Count, 154);
        Expect("in the frustum", frustum.Visible, 114);
        Expect("visible", sum.Visible, 14);

        Vis.Check(Vis.vis_visible_indices(visible, scene, null, UIntPtr.Zero, out UIntPtr count));
        var draw = new uint[(int)count];
        Vis.Check(Vis.vis_visible_indices(visible, scene, draw, count, out count));
        Expect("to draw", (ulong)draw.Length, 14);

        // The same by sets made ahead of the eye, from all places in a box of 0.6 m.
        double[] viewcell = { 0.6, 0.6, 0.6 }, wide = { 4.0, 4.0, 1.0 }, places = { 0.0, 0.0, eye };
        Vis.Check(Vis.vis_online_create(viewcell, wide, 0.2, out IntPtr online));
        Vis.OnlineWork work;
        do Vis.Check(Vis.vis_online_step(online, scene, places, (UIntPtr)1, 1000, out work));
        while (work.Worked);
        Vis.Check(Vis.vis_pipeline_create(out IntPtr ahead));
        Vis.Check(Vis.vis_pipeline_add_frustum(ahead));
        Vis.Check(Vis.vis_pipeline_add_online(ahead, online));
        Vis.Check(Vis.vis_pipeline_cull(ahead, scene, view, visible, out sum));
        Vis.Check(Vis.vis_online_answer(online, out int answer));
        Expect("answered by", (ulong)answer, Vis.AnswerViewcell);
        Expect("visible from a box", sum.Visible, 14);
        Vis.vis_pipeline_destroy(ahead);
        Vis.vis_online_destroy(online);

        Vis.Check(Vis.vis_scene_remove(scene, ids[0]));
        try
        {
            Vis.Check(Vis.vis_scene_remove(scene, ids[0]));
            Expect("unknown id", 0, 1);
        }
        catch (InvalidOperationException error)
        {
            Console.WriteLine($"message: {error.Message}");
        }
        Vis.vis_visible_destroy(visible);
        Vis.vis_view_destroy(view);
        Vis.vis_pipeline_destroy(pipeline);
        Vis.vis_scene_destroy(scene);
        Serve();
        Drawing.Run();
        Plans.Run();
    }

    static Vis.Wall Wall(double x, double y, double toX, double toY) =>
        new Vis.Wall { FromX = x, FromY = y, ToX = toX, ToY = toY };

    static Vis.Reach Player(double x) =>
        new Vis.Reach { MinX = x, MinY = 1, MaxX = x + 0.6, MaxY = 1.6, MaxZ = 1.8, Margin = 0.6 };

    // Two rooms with a door between them, and a player in each.
    static void Serve()
    {
        Vis.Wall[] walls = {
            Wall(0, 0, 8, 0), Wall(8, 0, 8, 4), Wall(8, 4, 0, 4), Wall(0, 4, 0, 0), Wall(4, 0, 4, 3),
            Wall(4, 3, 4, 4) };
        Vis.Reach[] players = { Player(1), Player(6) };
        UIntPtr two = (UIntPtr)2;
        Vis.Check(Vis.vis_sight_cells_create_of_plan(walls, (UIntPtr)6, 0, 1, out IntPtr cells));
        Vis.Check(Vis.vis_who_sees_create(out IntPtr whoSees));
        var seen = new uint[2];
        for (uint open = 0; open < 2; open++)
        {
            if (open == 1) Vis.Check(Vis.vis_sight_cells_set_opacity(cells, 5, Vis.Clear));
            Vis.Check(Vis.vis_who_sees_look(whoSees, cells, IntPtr.Zero, players, two, players, two));
            Vis.Check(Vis.vis_who_sees_seen_by(whoSees, UIntPtr.Zero, seen, two, out UIntPtr count));
            Expect(open == 1 ? "seen, open door" : "seen, closed door", (ulong)count, 1 + open);
        }
        Vis.vis_who_sees_destroy(whoSees);
        Vis.vis_sight_cells_destroy(cells);
    }
}
