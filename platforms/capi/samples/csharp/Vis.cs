// What the samples call of the C library, by P/Invoke: `visibility.h` says what each function does. The library must be
// where the loader looks: beside the program, or on LD_LIBRARY_PATH (Linux), DYLD_LIBRARY_PATH (macOS), PATH (Windows).
// The test of the header finds functions that differ from it.
using System;
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

    [StructLayout(LayoutKind.Sequential)]
    public struct WallHit
    {
        public double X, Y;
        public uint Wall;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Pose
    {
        public double EyeX, EyeY, EyeZ, TargetX, TargetY, TargetZ, UpX, UpY, UpZ;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Volume
    {
        public double MinX, MinY, MinZ, MaxX, MaxY, MaxZ;
        public uint FirstPlane, PlaneCount;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Lod
    {
        public ulong Object;
        public uint Level, Previous;
        public float Fade, Opacity;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct DrawGroup
    {
        public uint Key, First, Count;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct DrawCommand
    {
        public uint IndexCount, InstanceCount, FirstIndex;
        public int BaseVertex;
        public uint FirstInstance;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Reflection
    {
        public uint Mirror, Parent, Depth;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct RayHit
    {
        public ulong Object;
        public float Distance;
    }

    // Flags of objects; combine them with `|`.
    public const uint NeverCull = 1, Occluder = 2, SeeThrough = 4, OneSided = 8;
    public const uint DepthReversedInfinite = 5, AbiVersion = 1, Clear = 1;
    public const uint NoReflection = uint.MaxValue, NoWall = uint.MaxValue, AllLayers = uint.MaxValue;
    public const ulong NoObject = uint.MaxValue;
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

    // Levels of detail, stand-ins and draw ranges.
    [DllImport(Library)] public static extern int vis_view_set_perspective(
        IntPtr view, ref Pose pose, double fovY, double aspect, double near, double far);
    [DllImport(Library)] public static extern int vis_scene_set_lod_sizes(
        IntPtr scene, ulong[] ids, UIntPtr count, float[] sizes, UIntPtr sizeCount);
    [DllImport(Library)] public static extern int vis_scene_set_draw_range(
        IntPtr scene, ulong id, float begin, float end);
    [DllImport(Library)] public static extern int vis_scene_set_draw_range_with_margin(
        IntPtr scene, ulong id, float begin, float end, float margin);
    [DllImport(Library)] public static extern int vis_scene_set_hlod_parent(IntPtr scene, ulong id, ulong parent);
    [DllImport(Library)] public static extern int vis_pipeline_add_contribution(
        IntPtr pipeline, double pictureHeight, double minPixels);
    [DllImport(Library)] public static extern int vis_pipeline_set_contribution(
        IntPtr pipeline, double pictureHeight, double minPixels, double[] distanceEye);
    [DllImport(Library)] public static extern int vis_lods_create(
        double pictureHeight, double hysteresis, float fadeSeconds, out IntPtr lods);
    [DllImport(Library)] public static extern void vis_lods_destroy(IntPtr lods);
    [DllImport(Library)] public static extern int vis_lods_set_picture_height(IntPtr lods, double pictureHeight);
    [DllImport(Library)] public static extern int vis_lods_set_distance_eye(IntPtr lods, double[] eye);
    [DllImport(Library)] public static extern int vis_lods_select(
        IntPtr lods, IntPtr scene, IntPtr view, IntPtr visible, float elapsedSeconds);
    [DllImport(Library)] public static extern int vis_lods_selected(
        IntPtr lods, [Out] Lod[] list, UIntPtr capacity, out UIntPtr count);
    [DllImport(Library)] public static extern int vis_lods_lod(IntPtr lods, ulong id, out Lod lod);
    [DllImport(Library)] public static extern int vis_lods_reset(IntPtr lods);

    // Draw lists.
    [DllImport(Library)] public static extern int vis_scene_set_draw_keys(
        IntPtr scene, ulong[] ids, uint[] keys, UIntPtr count);
    [DllImport(Library)] public static extern int vis_draw_list_create(out IntPtr list);
    [DllImport(Library)] public static extern void vis_draw_list_destroy(IntPtr list);
    [DllImport(Library)] public static extern int vis_draw_list_group(IntPtr list, IntPtr scene, IntPtr visible);
    [DllImport(Library)] public static extern int vis_draw_list_group_levels(
        IntPtr list, IntPtr scene, IntPtr lods);
    [DllImport(Library)] public static extern int vis_draw_list_group_fading(
        IntPtr list, IntPtr scene, IntPtr lods);
    [DllImport(Library)] public static extern int vis_draw_list_groups(
        IntPtr list, [Out] DrawGroup[] groups, UIntPtr capacity, out UIntPtr count);
    [DllImport(Library)] public static extern int vis_draw_list_instances(
        IntPtr list, [Out] uint[] indices, UIntPtr capacity, out UIntPtr count);
    [DllImport(Library)] public static extern int vis_draw_list_commands(
        IntPtr list, DrawCommand[] meshes, UIntPtr meshCount, [Out] DrawCommand[] commands, UIntPtr capacity,
        out UIntPtr count);

    // Cells and mirrors. `portals`, `planes` and `vertices` may be null where there are none.
    [DllImport(Library)] public static extern int vis_graph_create(
        UIntPtr cellCount, IntPtr portals, UIntPtr portalCount, double[] vertices, UIntPtr vertexCount,
        out IntPtr graph);
    [DllImport(Library)] public static extern void vis_graph_destroy(IntPtr graph);
    [DllImport(Library)] public static extern int vis_cells_create(
        IntPtr graph, Volume[] volumes, UIntPtr volumeCount, double[] planes, UIntPtr planeCount,
        double tolerance, out IntPtr cells);
    [DllImport(Library)] public static extern void vis_cells_destroy(IntPtr cells);
    [DllImport(Library)] public static extern int vis_cells_add_mirror(
        IntPtr cells, uint cell, double[] vertices, UIntPtr vertexCount, out uint mirror);
    [DllImport(Library)] public static extern int vis_cells_set_mirror(
        IntPtr cells, uint mirror, [MarshalAs(UnmanagedType.U1)] bool uncovered);
    [DllImport(Library)] public static extern int vis_reflections_create(
        IntPtr cells, UIntPtr maxCount, uint maxDepth, out IntPtr reflections);
    [DllImport(Library)] public static extern void vis_reflections_destroy(IntPtr reflections);
    [DllImport(Library)] public static extern int vis_pipeline_add_reflections(IntPtr pipeline, IntPtr reflections);
    [DllImport(Library)] public static extern int vis_reflections_list(
        IntPtr reflections, [Out] Reflection[] list, UIntPtr capacity, out UIntPtr count);
    [DllImport(Library)] public static extern int vis_reflections_left_out(IntPtr reflections, out uint count);
    [DllImport(Library)] public static extern int vis_reflections_read(
        IntPtr reflections, uint number, IntPtr view, IntPtr visible);
    [DllImport(Library)] public static extern int vis_view_matrix(
        IntPtr view, double[] origin, [Out] double[] matrix);
    [DllImport(Library)] public static extern int vis_view_clip_planes(
        IntPtr view, double[] origin, [Out] double[] planes, UIntPtr capacity, out UIntPtr count);
    [DllImport(Library)] public static extern int vis_visible_count(
        IntPtr visible, IntPtr scene, out UIntPtr count);
    [DllImport(Library)] public static extern int vis_visible_contains(
        IntPtr visible, IntPtr scene, ulong id, [MarshalAs(UnmanagedType.U1)] out bool contains);

    // Plans, and what is seen from a box. Points are 2 numbers, corners of boxes 3.
    [DllImport(Library)] public static extern int vis_plan_create(
        Wall[] walls, UIntPtr wallCount, out IntPtr plan);
    [DllImport(Library)] public static extern void vis_plan_destroy(IntPtr plan);
    [DllImport(Library)] public static extern int vis_plan_set_opacity(IntPtr plan, uint wall, uint opacity);
    [DllImport(Library)] public static extern int vis_plan_sees(
        IntPtr plan, double[] a, double[] b, [MarshalAs(UnmanagedType.U1)] out bool sees);
    [DllImport(Library)] public static extern int vis_plan_ray(
        IntPtr plan, double[] eye, double[] through, out WallHit hit);
    [DllImport(Library)] public static extern int vis_plan_visibility_polygon(
        IntPtr plan, double[] eye, double range, [Out] double[] coordinates, UIntPtr capacity,
        out UIntPtr count);
    [DllImport(Library)] public static extern int vis_plan_visible_walls(
        IntPtr plan, double[] eye, double range, [Out] uint[] walls, UIntPtr capacity, out UIntPtr count);
    [DllImport(Library)] public static extern int vis_plan_walls_seen_from_region(
        IntPtr plan, double[] points, UIntPtr pointCount, [Out] uint[] walls, UIntPtr capacity,
        out UIntPtr count);
    [DllImport(Library)] public static extern int vis_scene_set_triangles(
        IntPtr scene, ulong id, float[] triangles, UIntPtr count);
    [DllImport(Library)] public static extern int vis_scene_seen_from(
        IntPtr scene, double[] min, double[] max, [Out] uint[] words, UIntPtr capacity, out UIntPtr count);
    [DllImport(Library)] public static extern int vis_scene_prove_from(
        IntPtr scene, double[] min, double[] max, double clearance, uint mostSteps, [Out] uint[] words,
        UIntPtr capacity, out UIntPtr count);
    [DllImport(Library)] public static extern int vis_scene_first_hit(
        IntPtr scene, float[] origin, float[] direction, float maxDistance, uint layers, out RayHit hit);
    [DllImport(Library)] public static extern int vis_scene_in_box(
        IntPtr scene, ref Box area, uint layers, [Out] ulong[] ids, UIntPtr capacity, out UIntPtr count);

    public static void Check(int status)
    {
        if (status != 0)
            throw new InvalidOperationException(
                $"error {status}: {Marshal.PtrToStringUTF8(vis_last_error())}");
    }
}
