// What to draw, and how, as in drawing.c: levels of detail, a stand-in for a block of houses, draw lists with indirect
// commands, and what is seen in a mirror.
using System;

static class Drawing
{
    const int Statues = 40, Houses = 4, All = Statues + Houses + 1, Levels = 3, Meshes = 2 * Levels + 2;

    static void Expect(string what, ulong found, ulong expected) => Street.Expect(what, found, expected);

    static void Look(IntPtr view, double x)
    {
        var pose = new Vis.Pose { EyeX = x, EyeZ = 1, TargetX = x + 1, TargetZ = 1, UpZ = 1 };
        Vis.Check(Vis.vis_view_set_perspective(view, ref pose, 1.0, 1.5, 0.1, 1000.0));
    }

    // Statues every 4 m, of two meshes of three levels each, and a block of houses 200 m away.
    static IntPtr MakeStreet(ulong[] ids)
    {
        var objects = new Vis.ObjectDesc[All];
        var keys = new uint[All];
        for (int i = 0; i < Statues; i++)
        {
            float x = 4.0f * (i + 1);
            objects[i] = Vis.vis_object_default(new Vis.Box(x, -0.5f, 0, x + 1, 0.5f, 2));
            // The first level of the mesh; the others follow.
            keys[i] = i % 2 == 0 ? Levels : 0u;
        }
        for (int i = 0; i < Houses; i++)
        {
            float y = 10.0f * (i - 2);
            objects[Statues + i] = Vis.vis_object_default(new Vis.Box(200, y, 0, 209, y + 9, 12));
            keys[Statues + i] = 2 * Levels;
        }
        objects[All - 1] = Vis.vis_object_default(new Vis.Box(200, -20, 0, 209, 19, 12));
        keys[All - 1] = 2 * Levels + 1;
        Vis.Check(Vis.vis_scene_create(out IntPtr scene));
        Vis.Check(Vis.vis_scene_insert_batch(scene, objects, (UIntPtr)All, ids));
        Vis.Check(Vis.vis_scene_set_draw_keys(scene, ids, keys, (UIntPtr)All));
        // Level 0 from 300 pixels on, level 1 from 60 on, level 2 below.
        float[] sizes = { 300, 60 };
        Vis.Check(Vis.vis_scene_set_lod_sizes(scene, ids, (UIntPtr)Statues, sizes, (UIntPtr)2));
        // From 150 m on, the block is drawn in the place of its houses.
        Vis.Check(Vis.vis_scene_set_draw_range(scene, ids[All - 1], 150, 1e9f));
        for (int i = 0; i < Houses; i++)
            Vis.Check(Vis.vis_scene_set_hlod_parent(scene, ids[Statues + i], ids[All - 1]));
        return scene;
    }

    static void DrawStreet()
    {
        var ids = new ulong[All];
        IntPtr scene = MakeStreet(ids);
        UIntPtr meshCount = (UIntPtr)Meshes, all = (UIntPtr)All, count;
        Vis.Check(Vis.vis_view_create(out IntPtr view));
        Vis.Check(Vis.vis_visible_create(false, out IntPtr visible));
        Vis.Check(Vis.vis_pipeline_create(out IntPtr pipeline));
        Vis.Check(Vis.vis_pipeline_add_frustum(pipeline));
        Vis.Check(Vis.vis_pipeline_add_contribution(pipeline, 1080, 2));
        Vis.Check(Vis.vis_lods_create(1080, 0.1, 0.25f, out IntPtr lods));
        Vis.Check(Vis.vis_draw_list_create(out IntPtr list));

        // Each frame: cull, choose levels, group by mesh and level.
        Look(view, 0);
        Vis.Check(Vis.vis_pipeline_cull(pipeline, scene, view, visible, out _));
        Vis.Check(Vis.vis_lods_select(lods, scene, view, visible, 1.0f / 60));
        Vis.Check(Vis.vis_draw_list_group_levels(list, scene, lods));
        var groups = new Vis.DrawGroup[Meshes];
        Vis.Check(Vis.vis_draw_list_groups(list, groups, meshCount, out count));
        Expect("groups", (ulong)count, 7);
        Expect("near statues of a mesh", groups[3].Key == Levels ? groups[3].Count : 99, 1);
        Expect("far ones", groups[5].Key == Levels + 2 ? groups[5].Count : 99, 15);
        Expect("blocks", groups[6].Key == 2 * Levels + 1 ? groups[6].Count : 99, 1);

        // A command for each group; `instances` says which object an instance is.
        var meshes = new Vis.DrawCommand[Meshes];
        for (uint key = 0; key < Meshes; key++)
            meshes[key] = new Vis.DrawCommand { IndexCount = 3 * (key + 1), FirstIndex = 100 * key };
        var commands = new Vis.DrawCommand[Meshes];
        Vis.Check(Vis.vis_draw_list_commands(list, meshes, meshCount, commands, meshCount, out count));
        Expect("indices of the last", commands[6].IndexCount, 24);
        Expect("its first instance", commands[6].FirstInstance, Statues);
        var instances = new uint[All];
        Vis.Check(Vis.vis_draw_list_instances(list, instances, all, out count));
        Expect("instances", (ulong)count, Statues + 1);
        Expect("the last is the block", instances[Statues], All - 1);

        // 6 m on, the third statue has come so near that it changes its level.
        Look(view, 6);
        Vis.Check(Vis.vis_pipeline_cull(pipeline, scene, view, visible, out _));
        Vis.Check(Vis.vis_lods_select(lods, scene, view, visible, 0.1f));
        Vis.Check(Vis.vis_draw_list_group_fading(list, scene, lods));
        Vis.Check(Vis.vis_draw_list_groups(list, groups, meshCount, out count));
        Expect("groups that fade out", (ulong)count, 1);
        Expect("key that fades out", groups[0].Key, Levels + 1);
        Vis.Check(Vis.vis_lods_lod(lods, ids[2], out Vis.Lod lod));
        Expect("level that fades in", lod.Level, 0);
        Vis.Check(Vis.vis_lods_lod(lods, ids[0], out lod));
        Expect("no level behind", lod.Object, Vis.NoObject);
        var levels = new Vis.Lod[All];
        Vis.Check(Vis.vis_lods_selected(lods, levels, all, out count));
        Expect("levels", (ulong)count, Statues);
        Expect("the last is opaque", levels[Statues - 1].Opacity == 1.0f ? 1u : 0u, 1);

        // In a smaller window, for a light far behind the camera, which shows what the camera shows; all levels anew.
        double[] eye = { 6, 0, 1 };
        Vis.Check(Vis.vis_lods_set_picture_height(lods, 540));
        Vis.Check(Vis.vis_pipeline_set_contribution(pipeline, 540, 2, eye));
        Vis.Check(Vis.vis_lods_set_distance_eye(lods, eye));
        Vis.Check(Vis.vis_scene_set_draw_range_with_margin(scene, ids[0], 0, 1e9f, 0));
        Look(view, -400);
        Vis.Check(Vis.vis_pipeline_cull(pipeline, scene, view, visible, out _));
        Vis.Check(Vis.vis_lods_reset(lods));
        Vis.Check(Vis.vis_lods_select(lods, scene, view, visible, 0));
        Vis.Check(Vis.vis_draw_list_group(list, scene, visible));
        Vis.Check(Vis.vis_draw_list_groups(list, groups, meshCount, out count));
        Expect("groups by mesh", (ulong)count, 3);

        Vis.vis_draw_list_destroy(list);
        Vis.vis_lods_destroy(lods);
        Vis.vis_pipeline_destroy(pipeline);
        Vis.vis_visible_destroy(visible);
        Vis.vis_view_destroy(view);
        Vis.vis_scene_destroy(scene);
    }

    // A hall with a mirror ahead, in which the eye sees the vase behind it.
    static void LookIntoMirror()
    {
        UIntPtr none = UIntPtr.Zero, one = (UIntPtr)1, count;
        Vis.Volume[] rooms = { new Vis.Volume { MinY = -2, MaxX = 8, MaxY = 2, MaxZ = 3 } };
        double[] glass = { 8, -1, 2, 8, 1, 2, 8, 1, 0.5, 8, -1, 0.5 };
        Vis.Check(Vis.vis_graph_create(one, IntPtr.Zero, none, null, none, out IntPtr graph));
        Vis.Check(Vis.vis_cells_create(graph, rooms, one, null, none, 1e-6, out IntPtr cells));
        Vis.Check(Vis.vis_cells_add_mirror(cells, 0, glass, (UIntPtr)4, out uint mirror));
        Vis.Check(Vis.vis_reflections_create(cells, (UIntPtr)8, 2, out IntPtr reflections));
        Vis.Check(Vis.vis_scene_create(out IntPtr scene));
        Vis.ObjectDesc[] vases = { Vis.vis_object_default(new Vis.Box(0.5f, -0.2f, 0.5f, 0.9f, 0.2f, 1.4f)) };
        var ids = new ulong[1];
        Vis.Check(Vis.vis_scene_insert_batch(scene, vases, one, ids));
        Vis.Check(Vis.vis_view_create(out IntPtr view));
        Vis.Check(Vis.vis_view_create(out IntPtr mirrored));
        Vis.Check(Vis.vis_visible_create(false, out IntPtr visible));
        Vis.Check(Vis.vis_visible_create(false, out IntPtr shown));
        Vis.Check(Vis.vis_pipeline_create(out IntPtr pipeline));
        Vis.Check(Vis.vis_pipeline_add_frustum(pipeline));
        Vis.Check(Vis.vis_pipeline_add_reflections(pipeline, reflections));

        Look(view, 2);
        Vis.Check(Vis.vis_pipeline_cull(pipeline, scene, view, visible, out _));
        Vis.Check(Vis.vis_visible_count(visible, scene, out count));
        Expect("seen ahead", (ulong)count, 0);
        var list = new Vis.Reflection[8];
        Vis.Check(Vis.vis_reflections_list(reflections, list, (UIntPtr)8, out count));
        Expect("mirrors", (ulong)count, 1);
        Expect("seen by the eye itself", list[0].Mirror == mirror ? list[0].Parent : 0, Vis.NoReflection);
        Vis.Check(Vis.vis_reflections_read(reflections, 0, mirrored, shown));
        Vis.Check(Vis.vis_visible_contains(shown, scene, ids[0], out bool contains));
        Expect("vases in the mirror", contains ? 1u : 0u, 1);
        // To draw it with: triangles change their winding, and the clip plane keeps x <= 8.
        var matrix = new double[16];
        var planes = new double[4];
        Vis.Check(Vis.vis_view_matrix(mirrored, null, matrix));
        Vis.Check(Vis.vis_view_clip_planes(mirrored, null, planes, (UIntPtr)4, out count));
        Expect("numbers of the plane", (ulong)count, 4);
        Expect("it keeps what is before", planes[0] == -1 && Math.Abs(planes[3] - 8) < 1e-3 ? 1u : 0u, 1);
        Vis.Check(Vis.vis_reflections_left_out(reflections, out uint leftOut));
        Expect("mirrors left out", leftOut, 0);
        Vis.Check(Vis.vis_cells_set_mirror(cells, mirror, false));
        Vis.Check(Vis.vis_pipeline_cull(pipeline, scene, view, visible, out _));
        Vis.Check(Vis.vis_reflections_list(reflections, list, (UIntPtr)8, out count));
        Expect("once it is covered", (ulong)count, 0);

        Vis.vis_cells_destroy(cells);
        Vis.vis_graph_destroy(graph);
        Vis.vis_reflections_destroy(reflections);
        Vis.vis_pipeline_destroy(pipeline);
        Vis.vis_visible_destroy(shown);
        Vis.vis_visible_destroy(visible);
        Vis.vis_view_destroy(mirrored);
        Vis.vis_view_destroy(view);
        Vis.vis_scene_destroy(scene);
    }

    public static void Run()
    {
        DrawStreet();
        LookIntoMirror();
    }
}
