// Stands for packages that `copc` imports and that this page does not use (build.js).
export default undefined
