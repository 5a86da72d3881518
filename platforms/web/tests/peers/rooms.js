// An IFC4 file of rooms in a row, written line by line: walls, slabs, furniture, and one pane of glass.

/** Rooms in a row; their side, height and thickness of walls in metres. */
const [ROOMS, SIDE, HEIGHT, THICK] = [6, 5, 3, 0.2];
/** The wall that is of glass: between this room and the next. */
const GLASS = 0;
const FURNITURE = 8;

/** Letters of a global id, of which the first is at most 3. */
const DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$";
const real = (number) => (Number.isInteger(number) ? `${number}.` : String(Math.fround(number)));

/** An IFC file that grows line by line. */
class Lines {
  #lines = [];
  #ids = 0;

  /** Adds an entity, and returns what refers to it. */
  add(entity) {
    this.#lines.push(`#${this.#lines.length + 1}=${entity};`);
    return `#${this.#lines.length}`;
  }

  id() {
    const number = ++this.#ids;
    return `'${"0".repeat(20)}${DIGITS[number >> 6]}${DIGITS[number & 63]}'`;
  }

  toString() {
    return [
      "ISO-10303-21;",
      "HEADER;",
      "FILE_DESCRIPTION(('ViewDefinition [ReferenceView]'),'2;1');",
      "FILE_NAME('rooms.ifc','2026-01-01T00:00:00',(''),(''),'','','');",
      "FILE_SCHEMA(('IFC4'));",
      "ENDSEC;",
      "DATA;",
      ...this.#lines,
      "ENDSEC;",
      "END-ISO-10303-21;",
      "",
    ].join("\n");
  }
}

/**
 * Returns the text of the file, the number of its parts, and views in the axes of three.js: `eye`, `target`, and
 * `shows`, the greatest number of parts that a culler need leave.
 */
export function writeRooms() {
  const file = new Lines();
  const point = (...place) => file.add(`IFCCARTESIANPOINT((${place.map(real)}))`);
  const up = file.add("IFCDIRECTION((0.,0.,1.))");
  const along = file.add("IFCDIRECTION((1.,0.,0.))");
  const flat = file.add("IFCDIRECTION((1.,0.))");
  const at = (...place) => file.add(`IFCAXIS2PLACEMENT3D(${point(...place)},${up},${along})`);
  const origin = at(0, 0, 0);
  const context = file.add(`IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-05,${origin},$)`);
  const units = file.add(`IFCUNITASSIGNMENT((${file.add("IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)")}))`);
  file.add(`IFCPROJECT(${file.id()},$,'rooms',$,$,$,$,(${context}),${units})`);
  const placement = file.add(`IFCLOCALPLACEMENT($,${origin})`);
  const style = ([r, g, b], transparency) => {
    const color = file.add(`IFCCOLOURRGB($,${real(r)},${real(g)},${real(b)})`);
    const shading = file.add(
      `IFCSURFACESTYLERENDERING(${color},${real(transparency)},$,$,$,$,$,$,.NOTDEFINED.)`,
    );
    return file.add(`IFCSURFACESTYLE($,.BOTH.,(${shading}))`);
  };
  let parts = 0;
  /** Adds a box with its middle at `x` and `y`, from `z` on upwards. */
  const part = (type, [x, y, z], [width, depth, height], look) => {
    const middle = file.add(`IFCAXIS2PLACEMENT2D(${point(0, 0)},${flat})`);
    const profile = file.add(`IFCRECTANGLEPROFILEDEF(.AREA.,$,${middle},${real(width)},${real(depth)})`);
    const solid = file.add(`IFCEXTRUDEDAREASOLID(${profile},${at(x, y, z)},${up},${real(height)})`);
    file.add(`IFCSTYLEDITEM(${solid},(${look}),$)`);
    const body = file.add(`IFCSHAPEREPRESENTATION(${context},'Body','SweptSolid',(${solid}))`);
    const shape = file.add(`IFCPRODUCTDEFINITIONSHAPE($,$,(${body}))`);
    file.add(`${type}(${file.id()},$,'part ${parts}',$,$,${placement},${shape},$,$)`);
    parts++;
  };
  const plaster = style([0.8, 0.78, 0.7], 0);
  const glass = style([0.6, 0.8, 0.9], 0.7);
  const concrete = style([0.5, 0.5, 0.52], 0);
  const long = ROOMS * SIDE;
  for (const z of [-THICK, HEIGHT])
    part("IFCSLAB", [long / 2, 0, z], [long + THICK, SIDE + THICK, THICK], concrete);
  for (const side of [-1, 1])
    part("IFCWALL", [long / 2, (side * SIDE) / 2, 0], [long + THICK, THICK, HEIGHT], plaster);
  for (let wall = 0; wall <= ROOMS; wall++) {
    const isGlass = wall === GLASS + 1;
    const look = isGlass ? glass : plaster;
    part(isGlass ? "IFCPLATE" : "IFCWALL", [wall * SIDE, 0, 0], [THICK, SIDE - THICK, HEIGHT], look);
  }
  for (let room = 0; room < ROOMS; room++) {
    for (let i = 0; i < FURNITURE; i++) {
      const look = style([(i % 3) / 2, (room % 4) / 3, (i % 5) / 4], 0);
      const place = [room * SIDE + 1 + (i % 4), i < 4 ? -1.5 : 1.5, 0];
      part("IFCBUILDINGELEMENTPROXY", place, [0.4, 0.5, 0.5 + 0.1 * i], look);
    }
  }
  // Two slabs, two long walls, the walls on both sides of a room, and its furniture.
  const room = 6 + FURNITURE;
  return {
    text: file.toString(),
    parts,
    // Height is y in three.js, and y of the file is -z.
    views: [
      // Through the pane, the furniture of the next room and the wall behind it show.
      { name: "through glass", eye: [0.4, 1.6, 0], target: [30, 1.2, 0], shows: room + FURNITURE + 1 },
      { name: "between walls", eye: [12.5, 1.6, 0], target: [30, 1.2, 0.5], shows: room },
      { name: "from outside", eye: [-9, 1.6, 7], target: [5, 1.5, 0], shows: room },
    ],
  };
}
