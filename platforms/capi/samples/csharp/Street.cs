// A street with a wall that hides boxes, as in street.c, sets made ahead of an eye, and who sees whom, by
// P/Invoke. The library must be where the loader looks: beside the program, or on LD_LIBRARY_PATH (Linux),
// DYLD_LIBRARY_PATH (macOS), PATH (Windows).
using System;
using System.Collections.Generic;
using System.Runtime.InteropServices;

static class Vis
{
    const string Library = "visibility";

    [StructLayout(LayoutKind.Sequential)]
    public struct Box
    {
        public float MinX, MinY, MinZ, MaxX, MaxY, MaxZ;

        public Box(float x, float y, float z, float toX, float toY, float toZ)
        {
            (MinX, MinY, MinZ, MaxX, MaxY, MaxZ) = (x, y, z, toX, toY, toZ);
        }
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct ObjectDesc
    {
        public Box Bounds;
        public uint Layers, Cost, Flags;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Stats
    {
        public ulong Nodes, AcceptedSubtrees, Tests, Occluders, Visible;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct OnlineWork
    {
        [MarshalAs(UnmanagedType.U1)] public bool Worked;
        [MarshalAs(UnmanagedType.U1)] public bool Wide;
        [MarshalAs(UnmanagedType.U1)] public bool Finished;
        public Stats Stats;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Wall
    {
        public double FromX, FromY, ToX, ToY;
        public uint Opacity;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Reach
    {
        public double MinX, MinY, MinZ, MaxX, MaxY, MaxZ, Margin;
    }

    // Flags of objects; combine them with `|`.
    public const uint NeverCull = 1, Occluder = 2, SeeThrough = 4, OneSided = 8;
    public const uint DepthReversedInfinite = 5, AbiVersion = 1, Clear = 1;
    public const int AnswerViewcell = 2;

    [DllImport(Library)] public static extern uint vis_abi_version();
    [DllImport(Library)] static extern IntPtr vis_last_error();
    [DllImport(Library)] public static extern ObjectDesc vis_object_default(Box bounds);
    [DllImport(Library)] public static extern int vis_scene_create(out IntPtr scene);
    [DllImport(Library)] public static extern void vis_scene_destroy(IntPtr scene);
    [DllImport(Library)] public static extern int vis_scene_insert_batch(
        IntPtr scene, ObjectDesc[] objects, UIntPtr count, [Out] ulong[] ids);
    [DllImport(Library)] public static extern int vis_scene_add_box_mesh(
        IntPtr scene, ref Box bounds, out ulong mesh);
    [DllImport(Library)] public static extern int vis_scene_set_mesh(
        IntPtr scene, ulong id, ulong mesh, float[] transform);
    [DllImport(Library)] public static extern int vis_scene_rebuild(IntPtr scene);
    [DllImport(Library)] public static extern int vis_scene_remove(IntPtr scene, ulong id);
    [DllImport(Library)] public static extern int vis_view_create(out IntPtr view);
    [DllImport(Library)] public static extern void vis_view_destroy(IntPtr view);
    [DllImport(Library)] public static extern int vis_view_set_matrix(
        IntPtr view, float[] matrix, uint depth, double[] origin);
    [DllImport(Library)] public static extern int vis_pipeline_create(out IntPtr pipeline);
    [DllImport(Library)] public static extern void vis_pipeline_destroy(IntPtr pipeline);
    [DllImport(Library)] public static extern int vis_pipeline_add_frustum(IntPtr pipeline);
    [DllImport(Library)] public static extern int vis_pipeline_add_z_buffer(
        IntPtr pipeline, UIntPtr width, UIntPtr height);
    [DllImport(Library)] public static extern int vis_pipeline_cull(
        IntPtr pipeline, IntPtr scene, IntPtr view, IntPtr visible, out Stats stats);
    [DllImport(Library)] public static extern int vis_pipeline_stage_stats(
        IntPtr pipeline, UIntPtr stage, out Stats stats);
    [DllImport(Library)] public static extern int vis_visible_create(
        [MarshalAs(UnmanagedType.U1)] bool withChanges, out IntPtr visible);
    [DllImport(Library)] public static extern void vis_visible_destroy(IntPtr visible);
    [DllImport(Library)] public static extern int vis_visible_indices(
        IntPtr visible, IntPtr scene, [Out] uint[] indices, UIntPtr capacity, out UIntPtr count);

    [DllImport(Library)] public static extern int vis_online_create(
        double[] viewcell, double[] wide, double margin, out IntPtr online);
    [DllImport(Library)] public static extern void vis_online_destroy(IntPtr online);
    [DllImport(Library)] public static extern int vis_online_step(
        IntPtr online, IntPtr scene, double[] places, UIntPtr placeCount, uint budget, out OnlineWork work);
    [DllImport(Library)] public static extern int vis_online_answer(IntPtr online, out int answer);
    [DllImport(Library)] public static extern int vis_pipeline_add_online(IntPtr pipeline, IntPtr online);
    [DllImport(Library)] public static extern int vis_sight_cells_create_of_plan(
        Wall[] walls, UIntPtr wallCount, uint xAxis, uint yAxis, out IntPtr cells);
    [DllImport(Library)] public static extern void vis_sight_cells_destroy(IntPtr cells);
    [DllImport(Library)] public static extern int vis_sight_cells_set_opacity(
        IntPtr cells, uint wall, uint opacity);
    [DllImport(Library)] public static extern int vis_who_sees_create(out IntPtr whoSees);
    [DllImport(Library)] public static extern void vis_who_sees_destroy(IntPtr whoSees);
    [DllImport(Library)] public static extern int vis_who_sees_look(
        IntPtr whoSees, IntPtr cells, IntPtr scene, Reach[] observers, UIntPtr observerCount,
        Reach[] targets, UIntPtr targetCount);
    [DllImport(Library)] public static extern int vis_who_sees_seen_by(
        IntPtr whoSees, UIntPtr observer, [Out] uint[] targets, UIntPtr capacity, out UIntPtr count);

    public static void Check(int status)
    {
        if (status != 0)
            throw new InvalidOperationException(
                $"error {status}: {Marshal.PtrToStringUTF8(vis_last_error())}");
    }
}

static class Street
{
    static void Expect(string what, ulong found, ulong expected)
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
