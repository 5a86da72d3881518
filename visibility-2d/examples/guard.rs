//! A guard in a castle: prints a map of what the guard sees, with the gate closed and open.
//!
//! `cargo run -p visibility-2d --example guard`

use visibility_2d::cdt::{Opacity, Plan, PlanError, PlanView, Visibility, Wall};

fn main() -> Result<(), PlanError> {
    // The walls of the castle: an outer wall, a keep inside, and a gate in the outer wall.
    let square = |low: f64, high: f64| {
        let corners = [[low, low], [high, low], [high, high], [low, high]];
        (0..4).map(move |i| Wall::new(corners[i], corners[(i + 1) % 4]))
    };
    let mut walls: Vec<_> = square(8.0, 12.0).chain(square(0.0, 20.0).skip(1)).collect();
    walls.push(Wall::new([0.0, 0.0], [4.0, 0.0]));
    walls.push(Wall::new([7.0, 0.0], [20.0, 0.0]));
    let gate = walls.len() as u32;
    walls.push(Wall::new([4.0, 0.0], [7.0, 0.0]));
    let mut plan = Plan::from_walls(&walls, 6.0)?;

    let guard = [4.5, 9.5];
    let mut answer = Visibility::new();
    for (opacity, gate_is) in [(Opacity::Opaque, "closed"), (Opacity::Clear, "open")] {
        plan.set_opacity(gate, opacity)?;
        plan.look(&PlanView::new(guard).with_range(16.0), &mut answer)?;
        println!("gate {gate_is}: {:.0} square metres, {} walls", answer.area(), answer.walls().len());
        for row in (-6..20).rev() {
            let cell = |column: i32| {
                let point = [f64::from(column) + 0.5, f64::from(row) + 0.5];
                let distance = (point[0] - guard[0]).hypot(point[1] - guard[1]);
                match distance < 16.0 && plan.sees(guard, point)? {
                    _ if distance == 0.0 => Ok('@'),
                    true => Ok('.'),
                    false => Ok(' '),
                }
            };
            let line = (0..20).map(cell).collect::<Result<String, PlanError>>()?;
            println!("{}", line.trim_end());
        }
    }
    Ok(())
}
