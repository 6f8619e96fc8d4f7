//! How many steps a ray takes: no more than its budget without losing what is far, and more where nothing is held.

use bevy::{
    math::DVec3,
    prelude::*,
    render::{camera::TemporalJitter, render_resource::TextureUsages},
};
use bevy_cumulus::{
    CloudFrame,
    prelude::*,
    reference::planet::{PLANET_RADIUS, shell_intervals},
};

use crate::support::{
    app::{View, cloud_pixels, read_image, until_drawn},
    gpu::run_updates,
    half::from_half,
    scene::{exact, slab_app, spawn_box, spawn_linear},
    shared::SharedApp,
};

const BOTTOM: f32 = 1500.0;
const TOP: f32 = 2500.0;

#[test]
fn a_ray_that_runs_out_of_steps_still_reaches_its_end() {
    for extinction in [0.000_02_f32, 0.0002] {
        let mut app = slab_app(BOTTOM, TOP, extinction);
        app.insert_resource(CloudLighting { fade_start: 1.0, aerial_perspective: 0.0, ..default() });
        // One direction a picture; the last passes below the layer and comes into it again.
        let view = spawn_linear(&mut app, UVec2::ONE, Transform::default());
        let narrow = PerspectiveProjection { fov: 0.0005, ..default() };
        app.world_mut().entity_mut(view.camera).insert(Projection::Perspective(narrow));
        for (height, degrees) in [(10.0, 30.0), (10.0, 6.0), (10.0, 1.0), (4000.0, -30.0), (3000.0, -1.3)] {
            let mu = f64::to_radians(degrees).sin();
            let direction = DVec3::new(0.0, mu, -(1.0 - mu * mu).sqrt()).as_vec3();
            let looking = Transform::from_xyz(0.0, height, 0.0).looking_to(direction, Vec3::X);
            app.world_mut().entity_mut(view.camera).insert(looking);
            let mut look = |max_steps, long_step| {
                let own = exact(MarchResolution::Full);
                let quality = CloudQuality { max_steps, long_step, step: 20.0, step_growth: 0.0, ..own };
                app.insert_resource(CloudQuality { max_distance: 2e6, light_steps: 6, ..quality });
                run_updates(&mut app, 2);
                until_drawn(&mut app);
                run_updates(&mut app, 1);
                cloud_pixels(&app, &view)[0]
            };
            let [bottom, top] = [BOTTOM, TOP].map(f64::from);
            let parts = shell_intervals(height.into(), mu, bottom, top, PLANET_RADIUS, 2e6);
            assert_eq!(parts.len(), if degrees == -1.3 { 2 } else { 1 });
            let way: f64 = parts.iter().map(|[a, b]| b - a).sum();
            let right = (-f64::from(extinction) * way).exp() as f32;
            let fine = look(8192, 4);
            for (most, long) in [(1, 4), (24, 1), (48, 4), (200, 4)] {
                let coarse = look(most, long);
                println!("{height} m, {degrees}°, {most} steps: {coarse}, {fine} in full, {right} let through");
                // A uniform slab's transmittance does not depend on the steps, if they cross it all. Stored as a half float.
                let passes = (coarse.w - right).abs() < 2e-3;
                assert!(passes, "{height} m, {degrees}°, {most} steps: {} comes through, not {right}", coarse.w);
                // Coarse steps see shade where they stand: not dark for that.
                let ratio = coarse.x / fine.x;
                assert!(most < 24 || (0.95..1.05).contains(&ratio), "{degrees}°, {most} steps: {ratio} as bright");
            }
        }
    }
}

/// A camera on a uniform slab that shows its rays' steps, and the newest frame as it is marched.
struct Counted {
    app: SharedApp,
    view: View,
    frame: Handle<Image>,
}

const SIZE: UVec2 = UVec2::new(32, 20);

fn counted(temporal: TemporalMode) -> Counted {
    let mut app = slab_app(BOTTOM, TOP, 0.0001);
    app.insert_resource(CloudQuality { temporal, step: 60.0, offsets: true, ..exact(MarchResolution::Full) });
    let view = spawn_linear(&mut app, SIZE, Transform::default());
    let mut image = CloudFrame::image(SIZE.x, SIZE.y);
    image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let frame = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    let debug = CloudDebugView::Steps;
    app.world_mut().entity_mut(view.camera).insert((CloudFrame(frame.clone()), CloudView { debug, ..default() }));
    let mut counted = Counted { app, view, frame };
    counted.turn(0.0);
    run_updates(&mut counted.app, 1);
    until_drawn(&mut counted.app);
    run_updates(&mut counted.app, 12);
    counted
}

impl Counted {
    fn turn(&mut self, yaw: f32) {
        let turned = Quat::from_rotation_y(yaw) * Quat::from_rotation_x(0.6);
        self.app.world_mut().entity_mut(self.view.camera).insert(Transform::from_rotation(turned));
    }

    /// Steps of each texel's ray in the newest frame; 0 where it took none.
    fn steps(&self) -> Vec<f64> {
        let texels: Vec<[u16; 4]> = bytemuck::pod_collect_to_vec(&read_image(&self.app, &self.frame));
        let most = f64::from(CloudQuality::high().max_steps);
        texels.into_iter().map(|texel| (1.0 + most).powf(hot(texel.map(from_half)) / 4.0) - 1.0).collect()
    }
}

/// What `heat` of debug.wesl made this colour of, 0 to 4.
fn hot([r, g, b, _]: [f64; 4]) -> f64 {
    match () {
        () if g >= 1.0 => 3.0 + b,
        () if g > 0.0 => 2.0 + g,
        () if r > 0.0 => 1.0 + r,
        () => b,
    }
}

#[test]
fn what_comes_into_view_gets_twice_the_steps() {
    // Radians a frame: three columns come in on the right.
    const TURN: f32 = 0.1;
    for temporal in [TemporalMode::SlidingWindow, TemporalMode::Exponential] {
        let mut counted = counted(temporal);
        let rest = counted.steps();
        for k in 1..5 {
            counted.turn(-TURN * k as f32);
            run_updates(&mut counted.app, 1);
        }
        let moving = counted.steps();
        let row = |steps: &[f64], columns: std::ops::Range<u32>| {
            let all = (0..SIZE.y).flat_map(|y| columns.clone().map(move |x| (y * SIZE.x + x) as usize));
            let (sum, count) = all.fold((0.0, 0.0), |(sum, count), i| (sum + steps[i], count + 1.0));
            sum / count
        };
        let [before, inside, coming] =
            [row(&rest, 4..28), row(&moving, 4..28), row(&moving, SIZE.x - 1..SIZE.x) / row(&rest, SIZE.x - 1..SIZE.x)];
        println!("{temporal:?}: {before:.1} steps at rest, {inside:.1} moving, {coming:.2} times as many coming in");
        assert!((inside / before - 1.0).abs() < 0.05, "{temporal:?}: {inside} steps moving, {before} at rest");
        assert!((1.8..2.2).contains(&coming), "{temporal:?}: {coming} times as many steps coming in");
        // After a cut nothing is dearer than at rest.
        counted.turn(1.5);
        run_updates(&mut counted.app, 1);
        let cut = row(&counted.steps(), 4..28);
        assert!((cut / before - 1.0).abs() < 0.05, "{temporal:?}: {cut} steps after a cut, {before} at rest");
    }
}

#[test]
fn edges_that_jitter_get_no_more_steps() {
    let mut counted = counted(TemporalMode::SlidingWindow);
    let open = counted.steps();
    // A board across the view whose edges no row of pixels follows.
    let camera = *counted.app.world().get::<Transform>(counted.view.camera).expect("a camera");
    let board = camera * Transform::from_xyz(0.0, 0.0, -200.0).with_rotation(Quat::from_rotation_z(0.7));
    spawn_box(&mut counted.app, Vec3::new(60.0, 500.0, 0.1), board, Vec3::ONE);
    let (mut flips, mut doubled, mut before) = (0, 0, open.clone());
    for k in 0..24 {
        // As TAA has it, half a pixel either way.
        let (x, y) = ([-0.45, 0.45][k % 2], [-0.45, 0.45][k / 2 % 2]);
        counted.app.world_mut().entity_mut(counted.view.camera).insert(TemporalJitter { offset: Vec2::new(x, y) });
        run_updates(&mut counted.app, 1);
        let now = counted.steps();
        if k >= 12 {
            flips += now.iter().zip(&before).filter(|(now, before)| (**now > 0.0) != (**before > 0.0)).count();
            doubled += now.iter().zip(&open).filter(|(now, open)| **now > 1.5 * **open).count();
        }
        before = now;
    }
    println!("{flips} texels were covered or uncovered, {doubled} took twice the steps");
    assert!(flips > 50, "only {flips} texels were covered or uncovered, so nothing is tested");
    // Where the picture ends there may be no neighbour that saw as far.
    assert!(doubled * 20 < flips, "{doubled} of {flips} texels took twice the steps");
}
