"use strict";
// How a view is painted: WebGL 2 where there is one, else a plain canvas with the facets sorted from back to front.
const VERTEX = `#version 300 es
in vec3 position; in vec3 moved; in float value;
uniform mat3 axes; uniform vec2 scale; uniform vec2 shift; uniform float depth; uniform float factor; uniform float lift;
out vec3 place; out float t;
void main() {
  place = axes * (position + factor * moved);
  t = value;
  gl_Position = vec4(place.xy * scale + shift, -place.z * depth - lift, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision highp float; precision highp sampler2D;
in vec3 place; in float t;
uniform vec4 color; uniform float bands; uniform sampler2D map; uniform float lit;
out vec4 ink;
void main() {
  vec3 c = color.rgb;
  if (bands > 0.5) c = t < -0.5 ? vec3(0.78) : texelFetch(map, ivec2(int(clamp(floor(t * bands), 0.0, bands - 1.0)), 0), 0).rgb;
  if (lit > 0.5) {
    vec3 n = cross(dFdx(place), dFdy(place));
    float size = length(n);
    float lamp = size > 0.0 ? clamp(dot(n / size * sign(n.z), normalize(vec3(-0.35, 0.45, 0.82))), 0.0, 1.0) : 1.0;
    float dark = bands > 0.5 ? 0.84 : 0.68;
    c *= dark + (1.03 - dark) * lamp;
  }
  ink = vec4(c, color.a);
}`;

// lines that no solid stands behind must be seen on dark paper
const inked = (part) => (part.lines && !part.edge ? theme.ink(part.color) : part.color);
const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);

class GlPainter {
  constructor(canvas) {
    // kept for reading back: screenshots and tests
    const gl = (this.gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true }));
    if (!gl) throw new Error("no WebGL 2");
    const program = (this.program = gl.createProgram());
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    this.at = Object.fromEntries(["axes", "scale", "shift", "depth", "factor", "lift", "color", "bands", "map", "lit"].map((n) => [n, gl.getUniformLocation(program, n)]));
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.map = gl.createTexture();
  }
  load(parts) {
    const gl = this.gl;
    this.parts = parts.map((part) => {
      const buffers = {};
      for (const [name, size] of [["position", 3], ["moved", 3], ["value", 1]]) {
        if (!part[name]) continue;
        const buffer = gl.createBuffer();
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.bufferData(gl.ARRAY_BUFFER, part[name], gl.STATIC_DRAW);
        buffers[name] = [buffer, size];
      }
      return { ...part, buffers, count: part.position.length / 3 };
    });
  }
  values(k, value) {
    const gl = this.gl, part = this.parts[k];
    const buffer = part.buffers.value?.[0] ?? gl.createBuffer();
    part.buffers.value = [buffer, 1];
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, value, gl.STATIC_DRAW);
  }
  colours(list) {
    const gl = this.gl;
    this.bands = list.length;
    gl.bindTexture(gl.TEXTURE_2D, this.map);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, list.length, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(list.flatMap((h) => [...rgb(h).map((c) => Math.round(255 * c)), 255])));
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  }
  draw(camera, factor, edges, glassy) {
    const gl = this.gl, at = this.at, canvas = gl.canvas;
    gl.depthMask(true); // or the depths of the last drawing would stay
    gl.clearColor(...rgb(theme.paper), 1);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix3fv(at.axes, false, [0, 1, 2].flatMap((j) => camera.axes.map((axis) => axis[j])));
    gl.uniform2f(at.scale, (2 * camera.zoom) / camera.width, (2 * camera.zoom) / camera.height);
    gl.uniform2f(at.shift, (2 * camera.shift[0]) / camera.width, (2 * camera.shift[1]) / camera.height);
    gl.uniform1f(at.depth, 0.4 / camera.radius);
    gl.uniform1i(at.map, 0);
    for (const part of this.parts) {
      if (part.edge && !edges) continue;
      const banded = part.banded && this.bands > 0 && part.buffers.value;
      gl.uniform1f(at.factor, part.moved ? factor : 0);
      gl.uniform1f(at.lift, part.lines ? 0.0012 : 0);
      gl.uniform4f(at.color, ...rgb(inked(part)), part.banded && glassy ? 0.3 : (part.opacity ?? 1));
      gl.depthMask(!(part.banded && glassy));
      gl.uniform1f(at.bands, banded ? this.bands : 0);
      gl.uniform1f(at.lit, part.lines ? 0 : 1);
      ["position", "moved", "value"].forEach((name) => {
        const place = gl.getAttribLocation(this.program, name);
        const found = part.buffers[name];
        if (!found) {
          gl.disableVertexAttribArray(place);
          gl.vertexAttrib3f(place, 0, 0, 0);
          return;
        }
        gl.bindBuffer(gl.ARRAY_BUFFER, found[0]);
        gl.enableVertexAttribArray(place);
        gl.vertexAttribPointer(place, found[1], gl.FLOAT, false, 0, 0);
      });
      if (part.arrows) {
        // what a solid hides of an arrow still shows, pale: forces between two solids would never be seen
        gl.disable(gl.DEPTH_TEST);
        gl.uniform4f(at.color, ...rgb(part.color), 0.4);
        gl.drawArrays(gl.TRIANGLES, 0, part.count);
        gl.enable(gl.DEPTH_TEST);
        gl.uniform4f(at.color, ...rgb(part.color), 1);
      }
      gl.drawArrays(part.lines ? gl.LINES : gl.TRIANGLES, 0, part.count);
    }
  }
}

class PlainPainter {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.list = [];
  }
  load(parts) {
    this.parts = parts;
  }
  values(k, value) {
    this.parts[k].value = value;
  }
  colours(list) {
    this.list = list;
  }
  draw(camera, factor, edges, glassy) {
    const pen = this.pen, { width, height } = this.canvas, ratio = width / camera.width;
    pen.fillStyle = theme.paper;
    pen.fillRect(0, 0, width, height);
    const shapes = [];
    for (const part of this.parts) {
      if (part.edge && !edges) continue;
      const size = part.lines ? 2 : 3, p = part.position, f = part.moved ? factor : 0;
      for (let i = 0; i < p.length / 3; i += size) {
        const corners = [];
        let deep = 0;
        for (let k = i; k < i + size; k++) {
          const c = camera.see(p[3 * k] + (f ? f * part.moved[3 * k] : 0), p[3 * k + 1] + (f ? f * part.moved[3 * k + 1] : 0), p[3 * k + 2] + (f ? f * part.moved[3 * k + 2] : 0));
          corners.push(c);
          deep += c[2] / size;
        }
        let color = inked(part);
        if (part.banded && part.value && this.list.length) {
          const t = (part.value[i] + part.value[i + 1] + part.value[i + 2]) / 3;
          color = t < -0.5 ? "#c8c8c8" : this.list[Math.max(0, Math.min(this.list.length - 1, Math.floor(t * this.list.length)))];
        }
        shapes.push([deep + (part.arrows ? 4 * camera.radius : part.lines ? 0.004 * camera.radius : 0), corners, color, part]);
      }
    }
    shapes.sort((a, b) => a[0] - b[0]);
    for (const [, corners, color, part] of shapes) {
      pen.beginPath();
      corners.forEach(([a, b], k) => (k ? pen.lineTo(a * ratio, b * ratio) : pen.moveTo(a * ratio, b * ratio)));
      pen.globalAlpha = part.banded && glassy ? 0.3 : (part.opacity ?? 1);
      pen.strokeStyle = pen.fillStyle = color;
      pen.lineWidth = part.lines ? ratio : 0.7 * ratio;
      if (!part.lines) pen.fill();
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }
}
