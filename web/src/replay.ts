/** The module that a page loads: it registers `<pianomime-replay>`. */
export {};
